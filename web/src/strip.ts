/** The strip of modes below the time series: which mode, from when to when. */

import type { Scale } from "./axes.ts";
import { isSliding, showMode, type ModeNumbers } from "./modes.ts";
import { setFont, type Pen } from "./pen.ts";
import type { Run } from "./replies.ts";
import type { Theme } from "./theme.ts";

export const STRIP_HEIGHT = 16;
const REGION_HEIGHT = 7;
const NARROWEST_NAMED = 16;

/** Regions are narrow bands and sliding fills the strip, so that the two differ without colour too. */
export function drawStrip(pen: Pen, run: Run, numbers: ModeNumbers, time: Scale, top: number, theme: Theme): void {
  const [left, right] = time.places;
  pen.save();
  pen.beginPath();
  pen.rect(left, top - 14, right - left, STRIP_HEIGHT + 16);
  pen.clip();
  for (const piece of run.pieces) {
    const [from, to] = [time.at(run.t[piece.first]), time.at(run.t[piece.last])].sort((a, b) => a - b);
    if (to < left || from > right) continue;
    const slides = isSliding(piece.mode);
    const height = slides ? STRIP_HEIGHT : REGION_HEIGHT;
    pen.fillStyle = numbers.colour(piece.mode, theme);
    pen.fillRect(from, top + 0.5 * (STRIP_HEIGHT - height), Math.max(to - from - 0.75, 0.5), height);
  }
  nameModes(pen, run, time, top, theme);
  pen.restore();
}

/** The names of the modes above the strip, where they have room. */
function nameModes(pen: Pen, run: Run, time: Scale, top: number, theme: Theme): void {
  setFont(pen, 11.5);
  pen.fillStyle = theme.muted;
  pen.textAlign = "center";
  pen.textBaseline = "alphabetic";
  const [left, right] = time.places;
  for (const piece of run.pieces) {
    const ends = [time.at(run.t[piece.first]), time.at(run.t[piece.last])].sort((a, b) => a - b);
    const [from, to] = [Math.max(ends[0], left), Math.min(ends[1], right)];
    const name = showMode(piece.mode);
    const needed = Math.max(NARROWEST_NAMED, pen.measureText(name).width + 6);
    if (to - from >= needed) pen.fillText(name, 0.5 * (from + to), top - 3);
  }
}
