/** The key below a picture: samples of what is drawn, with names. */

import { explainMode, isSliding, type ModeNumbers } from "./modes.ts";
import { count } from "./numbers.ts";
import { circle, setFont, type Pen } from "./pen.ts";
import { SLIDING_WIDTH, SMOOTH_WIDTH, type Theme } from "./theme.ts";

export interface KeyEntry {
  readonly label: string;
  /** Draw the sample around (0, y), from x to x + SAMPLE. */
  sample(pen: Pen, x: number, y: number, theme: Theme): void;
}

export const SAMPLE = 18;
const SIZE = 12;
const LINE = 21;
const GAP = 18;

/** The places of the entries, broken into lines, and the height that they take. */
export function layKey(
  pen: Pen,
  entries: readonly KeyEntry[],
  width: number,
): { x: number[]; y: number[]; height: number } {
  setFont(pen, SIZE);
  const x: number[] = [];
  const y: number[] = [];
  let [right, line] = [0, 0];
  for (const { label } of entries) {
    const size = SAMPLE + 7 + pen.measureText(label).width;
    if (right > 0 && right + size > width) [right, line] = [0, line + 1];
    x.push(right);
    y.push((line + 0.5) * LINE);
    right += size + GAP;
  }
  return { x, y, height: entries.length ? (line + 1) * LINE : 0 };
}

export function drawKey(
  pen: Pen,
  entries: readonly KeyEntry[],
  left: number,
  top: number,
  width: number,
  theme: Theme,
): void {
  pen.save();
  const { x, y } = layKey(pen, entries, width);
  entries.forEach((entry, k) => {
    pen.save();
    entry.sample(pen, left + x[k], top + y[k], theme);
    pen.restore();
    setFont(pen, SIZE);
    pen.fillStyle = theme.muted;
    pen.textAlign = "left";
    pen.textBaseline = "middle";
    pen.fillText(entry.label, left + x[k] + SAMPLE + 7, top + y[k] + 0.5);
  });
  pen.restore();
}

export function lineEntry(label: string, colour: string, width: number, dash: number[] = []): KeyEntry {
  return {
    label,
    sample(pen, x, y) {
      pen.strokeStyle = colour;
      pen.lineWidth = width;
      pen.setLineDash(dash);
      pen.beginPath();
      pen.moveTo(x, y);
      pen.lineTo(x + SAMPLE, y);
      pen.stroke();
    },
  };
}

function modeEntry(label: string, colour: string, slides: boolean): KeyEntry {
  return lineEntry(label, colour, slides ? SLIDING_WIDTH + 0.6 : SMOOTH_WIDTH + 0.5);
}

export function dotEntry(label: string, colour: string): KeyEntry {
  return {
    label,
    sample(pen, x, y) {
      pen.fillStyle = colour;
      circle(pen, x + SAMPLE / 2, y, 4);
      pen.fill();
    },
  };
}

/** Words without a sample: what the key leaves out. */
export function wordsEntry(label: string): KeyEntry {
  return { label, sample: () => undefined };
}

const MOST_MODES_NAMED = 8;

/** The modes of a run, not more of them than a reader takes in. */
export function modeEntries(
  modes: readonly string[],
  numbers: ModeNumbers,
  surfaces: readonly string[],
  theme: Theme,
): KeyEntry[] {
  const entries = modes
    .slice(0, MOST_MODES_NAMED)
    .map((mode) => modeEntry(explainMode(mode, surfaces), numbers.colour(mode, theme), isSliding(mode)));
  const left = modes.length - MOST_MODES_NAMED;
  return left > 0 ? [...entries, wordsEntry(`and ${count(left, "more mode")}`)] : entries;
}
