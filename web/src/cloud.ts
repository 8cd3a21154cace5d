/** Pictures that are points on two axes: the section, and the diagram that grows. */

import { clipTo, drawAxes, frameIn, padded, type Frame, type Interval } from "./axes.ts";
import { countPoints, shade, type Points } from "./counts.ts";
import { circle, type Pen } from "./pen.ts";
import type { Theme } from "./theme.ts";

export interface CloudData {
  readonly points: Points;
  readonly box: { readonly x: Interval; readonly y: Interval };
  readonly labels: readonly [string, string];
  readonly resolution: number;
  /** The rectangle that is being drawn with the pointer, in places. */
  readonly choice: { readonly x: Interval; readonly y: Interval } | null;
  /** Where the parameter stands now. */
  readonly line: number | null;
}

const MARGINS = { left: 66, right: 16, top: 30, bottom: 46 };
const DOTS_BELOW = 2500;

export function drawCloud(pen: Pen, width: number, height: number, data: CloudData, theme: Theme): Frame {
  const frame = frameIn(data.box.x, data.box.y, width, height, MARGINS);
  drawAxes(pen, frame, { xLabel: data.labels[0], yLabel: data.labels[1] }, theme);
  const [left, right] = frame.x.places;
  const [bottom, top] = frame.y.places;
  if (data.line !== null) drawLine(pen, frame, data.line, theme);
  if (data.points.length < DOTS_BELOW) drawDots(pen, data.points, frame, theme);
  else {
    const raster = shade(countPoints(data.points, frame, data.resolution), theme.ink);
    pen.raster(raster, left, top, right - left, bottom - top);
  }
  if (data.choice) drawChoice(pen, data.choice, theme);
  return frame;
}

/** The columns of pixels that points fall into, of a picture so wide. */
export function plotWidth(width: number): number {
  return width - MARGINS.left - MARGINS.right;
}

/** The interval of all points along one axis. */
export function spanOfPoints(values: Float64Array): Interval {
  let [low, high] = [Infinity, -Infinity];
  for (const value of values) {
    if (value < low) low = value;
    if (value > high) high = value;
  }
  return padded(low, high, 0.08);
}

const OUTLIERS = 0.05; // the share of points that may lie outside of the picture
const STRETCHED = 4; // where they would make it so many times as high
const SAMPLE = 4000;

/** The interval of most points along one axis: a few that lie far away, as near a resonance, do not flatten the rest. */
export function spanOfMost(values: Float64Array): Interval {
  const whole = spanOfPoints(values);
  const stride = Math.max(1, Math.floor(values.length / SAMPLE));
  const sorted = Float64Array.from({ length: Math.ceil(values.length / stride) }, (_, k) => values[k * stride]).sort();
  const at = (share: number) => sorted[Math.round(share * (sorted.length - 1))];
  const most = padded(at(OUTLIERS / 2), at(1 - OUTLIERS / 2), 0.25);
  return whole[1] - whole[0] > STRETCHED * (most[1] - most[0]) ? most : whole;
}

function drawDots(pen: Pen, points: Points, frame: Frame, theme: Theme): void {
  pen.save();
  clipTo(pen, frame);
  pen.fillStyle = theme.ink;
  pen.globalAlpha = points.length > 600 ? 0.55 : 0.8;
  const radius = points.length > 600 ? 1.2 : 2.4;
  const { x, y } = points;
  for (let k = 0; k < x.length; k++) {
    if (!Number.isFinite(x[k]) || !Number.isFinite(y[k])) continue;
    circle(pen, frame.x.at(x[k]), frame.y.at(y[k]), radius);
    pen.fill();
  }
  pen.restore();
}

function drawLine(pen: Pen, frame: Frame, value: number, theme: Theme): void {
  const x = frame.x.at(value);
  const [left, right] = frame.x.places;
  if (!(x >= left && x <= right)) return;
  pen.save();
  pen.strokeStyle = theme.accent;
  pen.globalAlpha = 0.6;
  pen.lineWidth = 1;
  pen.setLineDash([3, 3]);
  pen.beginPath();
  pen.moveTo(x, frame.y.places[0]);
  pen.lineTo(x, frame.y.places[1]);
  pen.stroke();
  pen.restore();
}

function drawChoice(pen: Pen, choice: NonNullable<CloudData["choice"]>, theme: Theme): void {
  pen.save();
  const [x, y] = [Math.min(...choice.x), Math.min(...choice.y)];
  const [width, height] = [Math.abs(choice.x[1] - choice.x[0]), Math.abs(choice.y[1] - choice.y[0])];
  pen.globalAlpha = 0.12;
  pen.fillStyle = theme.accent;
  pen.fillRect(x, y, width, height);
  pen.globalAlpha = 1;
  pen.strokeStyle = theme.accent;
  pen.lineWidth = 1;
  pen.beginPath();
  pen.rect(x, y, width, height);
  pen.stroke();
  pen.restore();
}
