/** Scales, ticks, and the two lines around a picture. */

import { showFixed, showName, withMinus } from "./numbers.ts";
import { setFont, type Pen } from "./pen.ts";
import type { Theme } from "./theme.ts";

export type Interval = readonly [number, number];

/** A linear map from values to places on the screen, and back. */
export interface Scale {
  readonly values: Interval;
  readonly places: Interval;
  at(value: number): number;
  back(place: number): number;
}

export function linear(values: Interval, places: Interval): Scale {
  const slope = (places[1] - places[0]) / (values[1] - values[0]);
  return {
    values,
    places,
    at: (value) => places[0] + (value - values[0]) * slope,
    back: (place) => values[0] + (place - places[0]) / slope,
  };
}

export interface Ticks {
  readonly step: number;
  readonly values: readonly number[];
  show(value: number): string;
}

const MOST_DECIMALS = 12;

/** About `wanted` ticks at multiples of 1, 2 or 5 times a power of ten. */
export function ticksOf([low, high]: Interval, wanted: number): Ticks {
  const size = high - low;
  if (!(size > 0) || !Number.isFinite(size)) return { step: 0, values: [low], show: String };
  const raw = size / Math.max(1, wanted);
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = power * ([1, 2, 5, 10].find((factor) => factor * power >= 0.8 * raw) ?? 10);
  const values: number[] = [];
  const first = Math.ceil(low / step - 1e-9);
  for (let k = first; k * step <= high + 1e-9 * step; k++) values.push(k * step);
  return { step, values, show: (value) => showTick(value, step, Math.max(Math.abs(low), Math.abs(high))) };
}

function showTick(value: number, step: number, largest: number): string {
  const rounded = Math.round(value / step) * step;
  if (largest >= 1e6 || largest < 1e-3) {
    if (rounded === 0) return "0";
    const digits = Math.max(0, Math.floor(Math.log10(Math.abs(rounded))) - Math.floor(Math.log10(step)));
    return withMinus(rounded.toExponential(Math.min(digits, MOST_DECIMALS))).replace("e+", "e");
  }
  const decimals = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  return showFixed(rounded === 0 ? 0 : rounded, Math.min(decimals, MOST_DECIMALS));
}

/** The interval of the values with a margin, never empty. */
export function spanOf(values: Iterable<number>, margin = 0.06): Interval {
  let low = Infinity;
  let high = -Infinity;
  for (const value of values) {
    if (value < low) low = value;
    if (value > high) high = value;
  }
  return padded(low, high, margin);
}

export function padded(low: number, high: number, margin: number): Interval {
  if (!Number.isFinite(low) || !Number.isFinite(high)) return [-1, 1];
  const size = high - low;
  const least = 1e-9 * Math.max(1, Math.abs(low), Math.abs(high));
  if (size < least) {
    const half = low === 0 ? 1 : 0.1 * Math.abs(low);
    return [low - half, high + half];
  }
  return [low - margin * size, high + margin * size];
}

/** The part of a picture in which values have places. */
export interface Frame {
  readonly x: Scale;
  readonly y: Scale;
}

export interface Margins {
  readonly left: number;
  readonly right: number;
  readonly top: number;
  readonly bottom: number;
}

export function frameIn(x: Interval, y: Interval, width: number, height: number, margins: Margins): Frame {
  return {
    x: linear(x, [margins.left, Math.max(margins.left + 10, width - margins.right)]),
    y: linear(y, [Math.max(margins.top + 10, height - margins.bottom), margins.top]),
  };
}

export interface AxesOptions {
  /** Whether the numbers along x are written, and the name. */
  readonly xLabel?: string | null;
  readonly yLabel: string;
  readonly yColour?: string;
}

const TICK_SIZE = 11.5;
const PIXELS_PER_TICK = { x: 90, y: 44 };

/** Draw the two axes with their ticks; names of quantities stand at their ends, upright. */
export function drawAxes(pen: Pen, frame: Frame, options: AxesOptions, theme: Theme): void {
  const [left, right] = frame.x.places;
  const [bottom, top] = frame.y.places;
  pen.save();
  pen.strokeStyle = theme.hair;
  pen.lineWidth = 1;
  pen.setLineDash([]);
  const across = ticksOf(frame.x.values, (right - left) / PIXELS_PER_TICK.x);
  const up = ticksOf(frame.y.values, Math.max(3, (bottom - top) / PIXELS_PER_TICK.y));
  pen.beginPath();
  for (const value of up.values) {
    const y = crisp(frame.y.at(value));
    pen.moveTo(left, y);
    pen.lineTo(right, y);
  }
  pen.stroke();
  pen.strokeStyle = theme.faint;
  pen.beginPath();
  pen.moveTo(left, crisp(bottom));
  pen.lineTo(right, crisp(bottom));
  if (options.xLabel !== null) {
    for (const value of across.values) {
      pen.moveTo(crisp(frame.x.at(value)), bottom);
      pen.lineTo(crisp(frame.x.at(value)), bottom + 4);
    }
  }
  pen.stroke();
  setFont(pen, TICK_SIZE);
  pen.fillStyle = theme.muted;
  pen.textAlign = "right";
  pen.textBaseline = "middle";
  for (const value of up.values) pen.fillText(up.show(value), left - 8, frame.y.at(value));
  pen.textBaseline = "alphabetic";
  pen.textAlign = "center";
  if (options.xLabel !== null) {
    for (const value of across.values) pen.fillText(across.show(value), frame.x.at(value), bottom + 18);
  }
  setFont(pen, 15, "name");
  pen.textAlign = "left";
  pen.fillStyle = options.yColour ?? theme.ink;
  pen.fillText(showName(options.yLabel), left, top - 9);
  if (options.xLabel) {
    pen.fillStyle = theme.ink;
    pen.textAlign = "right";
    pen.fillText(showName(options.xLabel), right, bottom + 36);
  }
  pen.restore();
}

/** Half a pixel aside, so that a line of one pixel is sharp. */
export function crisp(place: number): number {
  return Math.round(place) + 0.5;
}

export function clipTo(pen: Pen, frame: Frame): void {
  const [left, right] = frame.x.places;
  const [bottom, top] = frame.y.places;
  pen.beginPath();
  pen.rect(left, top, right - left, bottom - top);
  pen.clip();
}
