/** Curves of a run on a plane, piece by piece, and the places where the motion rests. */

import type { Frame } from "./axes.ts";
import { isSliding, sortModes } from "./modes.ts";
import type { Pen } from "./pen.ts";
import type { Piece, Run } from "./replies.ts";

/** Time as a coordinate, in place of the number of a state. */
export const TIME = -1;

export function coordinate(run: Run, row: number, which: number): number {
  return which === TIME ? run.t[row] : run.y[row * run.n + which];
}

/** Half of a pixel: what lies nearer to the last point drawn adds nothing. */
const LEAST_STEP = 0.4;

/** Add a piece to the path. */
export function tracePiece(pen: Pen, run: Run, piece: Piece, i: number, j: number, frame: Frame): void {
  let [lastX, lastY] = [NaN, NaN];
  for (let row = piece.first; row <= piece.last; row++) {
    const x = frame.x.at(coordinate(run, row, i));
    const y = frame.y.at(coordinate(run, row, j));
    if (row === piece.first) pen.moveTo(x, y);
    else if (row === piece.last || Math.abs(x - lastX) > LEAST_STEP || Math.abs(y - lastY) > LEAST_STEP)
      pen.lineTo(x, y);
    else continue;
    [lastX, lastY] = [x, y];
  }
}

/** A place where the motion rests while it slides, and for how long. */
export interface Dwell {
  readonly x: number;
  readonly y: number;
  readonly duration: number;
  readonly mode: string;
}

const RESTING = 2; // pixels
const SLOW = 0.2; // of the mean speed of the run
const SAME_PLACE = 3;

/**
 * The pieces of sliding that are points on the screen although they last; those at the same place are one, with the
 * sum of the times. A piece that is short because it is over soon is none.
 */
export function findDwells(run: Run, i: number, j: number, frame: Frame): Dwell[] {
  const found = new Map<string, Dwell>();
  const paths = run.pieces.map((piece) => measure(run, piece, i, j, frame));
  const whole = paths.reduce((sum, { duration }) => sum + duration, 0);
  const speed = whole > 0 ? paths.reduce((sum, { length }) => sum + length, 0) / whole : 0;
  run.pieces.forEach(({ mode }, k) => {
    const { x, y, width, height, length, duration } = paths[k];
    if (!isSliding(mode) || !(duration > 0) || !(width < RESTING) || !(height < RESTING)) return;
    if (length > SLOW * speed * duration) return;
    const key = `${mode} ${Math.round(x / SAME_PLACE)} ${Math.round(y / SAME_PLACE)}`;
    const known = found.get(key);
    found.set(key, known ? { ...known, duration: known.duration + duration } : { x, y, duration, mode });
  });
  return [...found.values()];
}

/** The middle, the extent and the length of a piece on the screen, and its duration. */
function measure(run: Run, piece: Piece, i: number, j: number, frame: Frame) {
  let [left, right, top, bottom, length] = [Infinity, -Infinity, Infinity, -Infinity, 0];
  let [lastX, lastY] = [NaN, NaN];
  for (let row = piece.first; row <= piece.last; row++) {
    const x = frame.x.at(coordinate(run, row, i));
    const y = frame.y.at(coordinate(run, row, j));
    [left, right] = [Math.min(left, x), Math.max(right, x)];
    [top, bottom] = [Math.min(top, y), Math.max(bottom, y)];
    if (row > piece.first) length += Math.hypot(x - lastX, y - lastY);
    [lastX, lastY] = [x, y];
  }
  const duration = Math.abs(run.t[piece.last] - run.t[piece.first]);
  return {
    x: 0.5 * (left + right),
    y: 0.5 * (top + bottom),
    width: right - left,
    height: bottom - top,
    length,
    duration,
  };
}

const SMALLEST_DOT = 2.5;
const DOT_OF_WHOLE_RUN = 14;

/** The radius of a dwell: its area grows with its share of the run. */
export function dwellRadius(duration: number, whole: number): number {
  return whole > 0 ? Math.max(SMALLEST_DOT, DOT_OF_WHOLE_RUN * Math.sqrt(duration / whole)) : SMALLEST_DOT;
}

/** What is asked of a run at every drawing is computed once. */
function remembered<T>(compute: (run: Run) => T): (run: Run) => T {
  const known = new WeakMap<Run, T>();
  return (run) => {
    let found = known.get(run);
    if (found === undefined) known.set(run, (found = compute(run)));
    return found;
  };
}

/** Bounds of the states of a run: `[low, high]` for each. */
export const boundsOf = remembered((run): readonly (readonly [number, number])[] => {
  const low = new Float64Array(run.n).fill(Infinity);
  const high = new Float64Array(run.n).fill(-Infinity);
  for (let k = 0, i = 0; k < run.y.length; k++) {
    const value = run.y[k];
    if (value < low[i]) low[i] = value;
    if (value > high[i]) high[i] = value;
    if (++i === run.n) i = 0;
  }
  return Array.from(low, (value, i) => [value, high[i]] as const);
});

/** The modes of a run, regions first. */
export const modesOf = remembered((run): readonly string[] => sortModes(run.pieces.map((piece) => piece.mode)));

/** The state and the mode at a time, between the points of the curve. */
export function stateAt(run: Run, t: number): { y: number[]; mode: string } | null {
  const backwards = run.t.length > 1 && run.t[run.t.length - 1] < run.t[0];
  for (const piece of run.pieces) {
    const [from, to] = [run.t[piece.first], run.t[piece.last]];
    if (backwards ? t > from || t < to : t < from || t > to) continue;
    let row = piece.first;
    while (row < piece.last - 1 && (backwards ? run.t[row + 1] > t : run.t[row + 1] < t)) row++;
    const next = Math.min(row + 1, piece.last);
    const size = run.t[next] - run.t[row];
    const share = size === 0 ? 0 : (t - run.t[row]) / size;
    const at = (r: number, i: number) => run.y[r * run.n + i];
    const y = Array.from({ length: run.n }, (_, i) => at(row, i) + share * (at(next, i) - at(row, i)));
    return { y, mode: piece.mode };
  }
  return null;
}

/** Rows between which the state jumps: the ends of pieces that do not meet. */
export const findJumps = remembered((run): readonly (readonly [number, number])[] => {
  const jumps: [number, number][] = [];
  const bounds = boundsOf(run);
  for (let k = 1; k < run.pieces.length; k++) {
    const [from, to] = [run.pieces[k - 1].last, run.pieces[k].first];
    const isJump = bounds.some(
      ([low, high], i) => Math.abs(run.y[from * run.n + i] - run.y[to * run.n + i]) > 1e-6 * (high - low),
    );
    if (isJump) jumps.push([from, to]);
  }
  return jumps;
});
