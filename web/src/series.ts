/** The time series: a panel for each state, the strip of modes below them, and the axis of time. */

import { clipTo, crisp, drawAxes, linear, padded, ticksOf, type Frame, type Interval } from "./axes.ts";
import { boundsOf, findJumps, modesOf, TIME, tracePiece } from "./curves.ts";
import { drawKey, layKey, modeEntries } from "./key.ts";
import { isSliding, type ModeNumbers } from "./modes.ts";
import { count, showNumber } from "./numbers.ts";
import { circle, setFont, type Pen } from "./pen.ts";
import type { Run } from "./replies.ts";
import { drawStrip, STRIP_HEIGHT } from "./strip.ts";
import { SLIDING_WIDTH, SMOOTH_WIDTH, type Theme } from "./theme.ts";

export interface SeriesData {
  readonly run: Run | null;
  readonly states: readonly string[];
  readonly surfaces: readonly string[];
  readonly modes: ModeNumbers;
  /** The states that have a panel. */
  readonly shown: readonly number[];
  /** The part of time that is shown. */
  readonly window: Interval;
  /** The interval of each state, by its number. */
  readonly spans: readonly Interval[];
  readonly cursor: { readonly t: number; readonly y: readonly number[] } | null;
}

const LEFT = 58;
const RIGHT = 16;
const GAP = 34;
const ABOVE_STRIP = 30;
const BELOW_STRIP = 44;
const CLOSEST_LINES = 6;

/** Draw the panels; the scale of time is what a pointer needs. */
export function drawSeries(pen: Pen, width: number, height: number, data: SeriesData, theme: Theme): Frame["x"] {
  const { run, shown } = data;
  const time = linear(data.window, [LEFT, Math.max(LEFT + 10, width - RIGHT)]);
  if (!run) return time;
  const entries = modeEntries(modesOf(run), data.modes, data.surfaces, theme);
  const key = layKey(pen, entries, width - LEFT - RIGHT);
  const floor = height - key.height - BELOW_STRIP - STRIP_HEIGHT - ABOVE_STRIP;
  const each = (floor - 4) / shown.length;
  shown.forEach((state, k) => {
    const top = 4 + k * each + (GAP - 8);
    const frame: Frame = { x: time, y: linear(data.spans[state], [Math.max(top + 8, 4 + (k + 1) * each), top]) };
    drawPanel(pen, run, state, frame, data, theme);
  });
  const top = height - key.height - BELOW_STRIP - STRIP_HEIGHT;
  drawStrip(pen, run, data.modes, time, top, theme);
  drawTime(pen, time, top + STRIP_HEIGHT + 6, theme);
  if (data.cursor) drawCursor(pen, time.at(data.cursor.t), 12, top + STRIP_HEIGHT, theme);
  drawKey(pen, entries, LEFT, height - key.height - 2, width - LEFT - RIGHT, theme);
  return time;
}

/** The intervals of all states over a run. */
export function spansOf(run: Run): Interval[] {
  return boundsOf(run).map(([low, high]) => padded(low, high, 0.08));
}

export function stateColour(state: number, theme: Theme): string {
  // vermilion and sky blue are not among the first colours of modes: the two kinds of colour are not mixed up
  const order = [theme.ink, theme.colours[5], theme.colours[4], theme.colours[3], theme.colours[2], theme.colours[6]];
  return order[state % order.length];
}

function drawPanel(pen: Pen, run: Run, state: number, frame: Frame, data: SeriesData, theme: Theme): void {
  const colour = stateColour(state, theme);
  drawAxes(pen, frame, { xLabel: null, yLabel: data.states[state], yColour: colour }, theme);
  pen.save();
  clipTo(pen, frame);
  drawSwitches(pen, run, frame, theme);
  pen.strokeStyle = colour;
  pen.lineJoin = "round";
  for (const slides of [false, true]) {
    pen.lineWidth = slides ? SLIDING_WIDTH - 0.8 : SMOOTH_WIDTH;
    pen.beginPath();
    for (const piece of run.pieces) {
      if (isSliding(piece.mode) === slides) tracePiece(pen, run, piece, TIME, state, frame);
    }
    pen.stroke();
  }
  pen.lineWidth = 1;
  pen.setLineDash([2, 3]);
  pen.beginPath();
  for (const [from, to] of findJumps(run)) {
    pen.moveTo(frame.x.at(run.t[from]), frame.y.at(run.y[from * run.n + state]));
    pen.lineTo(frame.x.at(run.t[to]), frame.y.at(run.y[to * run.n + state]));
  }
  pen.stroke();
  pen.setLineDash([]);
  if (data.cursor) {
    circle(pen, frame.x.at(data.cursor.t), frame.y.at(data.cursor.y[state]), 3.5);
    pen.fillStyle = colour;
    pen.fill();
  }
  pen.restore();
}

/** A line for each switch, but for those that would merge. */
function drawSwitches(pen: Pen, run: Run, frame: Frame, theme: Theme): void {
  const [bottom, top] = frame.y.places;
  pen.strokeStyle = theme.hair;
  pen.lineWidth = 1;
  pen.beginPath();
  let last = -Infinity;
  for (const { t } of run.switches) {
    const x = frame.x.at(t);
    if (Math.abs(x - last) < CLOSEST_LINES) continue;
    last = x;
    pen.moveTo(crisp(x), top);
    pen.lineTo(crisp(x), bottom);
  }
  pen.stroke();
}

function drawTime(pen: Pen, time: Frame["x"], y: number, theme: Theme): void {
  const [left, right] = time.places;
  const ticks = ticksOf(time.values, (right - left) / 90);
  pen.save();
  pen.strokeStyle = theme.faint;
  pen.lineWidth = 1;
  pen.beginPath();
  for (const value of ticks.values) {
    pen.moveTo(crisp(time.at(value)), y - 3);
    pen.lineTo(crisp(time.at(value)), y + 2);
  }
  pen.stroke();
  setFont(pen, 11.5);
  pen.fillStyle = theme.muted;
  pen.textAlign = "center";
  for (const value of ticks.values) pen.fillText(ticks.show(value), time.at(value), y + 15);
  setFont(pen, 15, "name");
  pen.fillStyle = theme.ink;
  pen.textAlign = "right";
  pen.fillText("t", right, y + 32);
  pen.restore();
}

function drawCursor(pen: Pen, x: number, top: number, bottom: number, theme: Theme): void {
  pen.strokeStyle = theme.muted;
  pen.lineWidth = 1;
  pen.setLineDash([]);
  pen.beginPath();
  pen.moveTo(crisp(x), top);
  pen.lineTo(crisp(x), bottom);
  pen.stroke();
}

/** The picture in a sentence. */
export function describeSeries(data: SeriesData): string {
  const { run, states, shown } = data;
  const names = shown.map((state) => states[state]).join(", ");
  if (!run) return `Time series of ${names}.`;
  const bounds = boundsOf(run);
  const ranges = shown.map(
    (state) => `${states[state]} between ${bounds[state].map((v) => showNumber(v, 4)).join(" and ")}`,
  );
  return (
    `Time series of ${names} from t = ${showNumber(data.window[0], 5)} to ${showNumber(data.window[1], 5)}: ` +
    `${ranges.join(", ")}; ${count(run.switches.length, "switch", "switches")}.`
  );
}
