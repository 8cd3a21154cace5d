/** The phase portrait: a plane of two states with the trajectory, surfaces, arrows of the field, and equilibria. */

import { clipTo, drawAxes, frameIn, padded, type Frame, type Interval } from "./axes.ts";
import { boundsOf, coordinate, dwellRadius, findDwells, findJumps, modesOf, tracePiece } from "./curves.ts";
import { dotEntry, drawKey, layKey, lineEntry, modeEntries, SAMPLE, type KeyEntry } from "./key.ts";
import { isSliding, type ModeNumbers } from "./modes.ts";
import { count, showNumber } from "./numbers.ts";
import { circle, setFont, type Pen } from "./pen.ts";
import type { Equilibrium, Plane, Run, SurfaceKind } from "./replies.ts";
import { SLIDING_WIDTH, SMOOTH_WIDTH, type Theme } from "./theme.ts";

export interface Box {
  readonly x: Interval;
  readonly y: Interval;
}

export interface PortraitData {
  readonly run: Run | null;
  readonly kept: readonly Run[];
  readonly cycle: Run | null;
  readonly plane: Plane | null;
  readonly axes: readonly [number, number];
  readonly box: Box;
  readonly states: readonly string[];
  readonly surfaces: readonly string[];
  readonly modes: ModeNumbers;
  readonly start: readonly number[];
  /** The state under the pointer of the time series. */
  readonly marked: readonly number[] | null;
  /** Whether the key names the modes too; on the page the time series beside it does. */
  readonly withModes: boolean;
}

const SIDES = { left: 58, right: 16, top: 30 };
const BELOW_AXIS = 46;
const ARROW = 9;
const CYCLE_WIDTH = 2.4;

/** Draw the portrait; the frame is what a pointer needs. */
export function drawPortrait(pen: Pen, width: number, height: number, data: PortraitData, theme: Theme): Frame {
  // the key depends on what rests on the screen, and the frame a little on the height of the key
  const almost = frameIn(data.box.x, data.box.y, width, height, { ...SIDES, bottom: BELOW_AXIS });
  const entries = keyEntries(data, almost, theme);
  const key = layKey(pen, entries, width - SIDES.left - SIDES.right);
  const bottom = BELOW_AXIS + key.height;
  const frame = frameIn(data.box.x, data.box.y, width, height, { ...SIDES, bottom });
  const [i, j] = data.axes;
  drawAxes(pen, frame, { xLabel: data.states[i], yLabel: data.states[j] }, theme);
  pen.save();
  if (data.plane && data.plane.instant !== null) drawInstant(pen, data.plane.instant, frame, theme);
  clipTo(pen, frame);
  pen.lineJoin = "round";
  if (data.plane) {
    drawField(pen, data.plane, frame, theme);
    drawSurfaces(pen, data.plane, frame, theme);
  }
  pen.globalAlpha = 0.4;
  for (const run of data.kept) drawRun(pen, run, data, frame, theme);
  pen.globalAlpha = 1;
  if (data.run) drawRun(pen, data.run, data, frame, theme);
  if (data.cycle) drawCycle(pen, data.cycle, data.axes, frame, theme);
  for (const point of data.plane?.equilibria ?? []) drawEquilibrium(pen, point, data.axes, frame, theme);
  drawStart(pen, data, frame, theme);
  if (data.marked) drawMark(pen, frame.x.at(data.marked[i]), frame.y.at(data.marked[j]), theme);
  pen.restore();
  drawKey(pen, entries, SIDES.left, height - key.height - 2, width - SIDES.left - SIDES.right, theme);
  return frame;
}

/** A box around a run, and around its start. */
export function boxOf(run: Run, [i, j]: readonly [number, number]): Box {
  const bounds = boundsOf(run);
  return { x: padded(...bounds[i], 0.08), y: padded(...bounds[j], 0.08) };
}

/** Whether a run fills the box well: it neither leaves it nor is lost in it. */
export function fits(run: Run, axes: readonly [number, number], box: Box): boolean {
  const bounds = boundsOf(run);
  return axes.every((which, k) => {
    const [low, high] = k === 0 ? box.x : box.y;
    const [from, to] = bounds[which];
    return from >= low && to <= high && to - from >= 0.35 * (high - low);
  });
}

function drawRun(pen: Pen, run: Run, { axes: [i, j], modes }: PortraitData, frame: Frame, theme: Theme): void {
  const whole = Math.abs(run.t[run.t.length - 1] - run.t[0]);
  pen.setLineDash([]);
  // sliding lies on the rest, for it is what the eye should find
  for (const slides of [false, true]) {
    for (const mode of modesOf(run)) {
      if (isSliding(mode) !== slides) continue;
      pen.strokeStyle = modes.colour(mode, theme);
      pen.lineWidth = slides ? SLIDING_WIDTH : SMOOTH_WIDTH;
      pen.beginPath();
      for (const piece of run.pieces) if (piece.mode === mode) tracePiece(pen, run, piece, i, j, frame);
      pen.stroke();
    }
  }
  pen.strokeStyle = theme.faint;
  pen.lineWidth = 1;
  pen.setLineDash([2, 3]);
  pen.beginPath();
  for (const [from, to] of findJumps(run)) {
    pen.moveTo(frame.x.at(coordinate(run, from, i)), frame.y.at(coordinate(run, from, j)));
    pen.lineTo(frame.x.at(coordinate(run, to, i)), frame.y.at(coordinate(run, to, j)));
  }
  pen.stroke();
  pen.setLineDash([]);
  for (const dwell of findDwells(run, i, j, frame)) {
    circle(pen, dwell.x, dwell.y, dwellRadius(dwell.duration, whole));
    pen.fillStyle = modes.colour(dwell.mode, theme);
    pen.fill();
    pen.strokeStyle = theme.ground;
    pen.lineWidth = 1.2;
    pen.stroke();
  }
}

/** A cycle lies on the trajectories, heavy, with a rim. */
function drawCycle(pen: Pen, run: Run, [i, j]: readonly [number, number], frame: Frame, theme: Theme): void {
  for (const [colour, width] of [
    [theme.ground, CYCLE_WIDTH + 2.4],
    [cycleColour(theme), CYCLE_WIDTH],
  ] as const) {
    pen.strokeStyle = colour;
    pen.lineWidth = width;
    pen.beginPath();
    for (const piece of run.pieces) tracePiece(pen, run, piece, i, j, frame);
    pen.stroke();
  }
}

function cycleColour(theme: Theme): string {
  return theme.colours[5];
}

/** At which time the field is as it is drawn. */
function drawInstant(pen: Pen, t: number, frame: Frame, theme: Theme): void {
  setFont(pen, 12);
  pen.fillStyle = theme.muted;
  pen.textAlign = "right";
  pen.textBaseline = "alphabetic";
  pen.fillText(`field at t = ${showNumber(t, 4)}`, frame.x.places[1], frame.y.places[1] - 10);
}

function drawField(pen: Pen, { field }: Plane, frame: Frame, theme: Theme): void {
  const scaleX = frame.x.at(1) - frame.x.at(0);
  const scaleY = frame.y.at(1) - frame.y.at(0);
  pen.strokeStyle = theme.faint;
  pen.globalAlpha = 0.75;
  pen.lineWidth = 1;
  pen.setLineDash([]);
  pen.beginPath();
  for (let k = 0; k + 3 < field.length; k += 4) {
    const [dx, dy] = [field[k + 2] * scaleX, field[k + 3] * scaleY];
    const size = Math.hypot(dx, dy);
    if (!(size > 0)) continue;
    const [u, v] = [dx / size, dy / size];
    const [x, y] = [frame.x.at(field[k]), frame.y.at(field[k + 1])];
    const [headX, headY] = [x + 0.5 * ARROW * u, y + 0.5 * ARROW * v];
    pen.moveTo(x - 0.5 * ARROW * u, y - 0.5 * ARROW * v);
    pen.lineTo(headX, headY);
    pen.moveTo(headX - 3.2 * u - 2 * v, headY - 3.2 * v + 2 * u);
    pen.lineTo(headX, headY);
    pen.lineTo(headX - 3.2 * u + 2 * v, headY - 3.2 * v - 2 * u);
  }
  pen.stroke();
  pen.globalAlpha = 1;
}

interface SurfaceLine {
  readonly label: string;
  readonly width: number;
  readonly dash: number[];
  colour(theme: Theme): string;
}

/** As in the figures of the Python package: solid and heavy where the surface attracts, dashed where it repels. */
const SURFACE_LINES: Record<SurfaceKind, SurfaceLine> = {
  attracting: { label: "attracting", width: 2.2, dash: [], colour: (theme) => theme.attracting },
  repelling: { label: "repelling", width: 1.8, dash: [7, 4], colour: (theme) => theme.repelling },
  crossing: { label: "crossing", width: 1.4, dash: [1.5, 3], colour: (theme) => theme.crossing },
  unknown: { label: "surface", width: 1, dash: [], colour: (theme) => theme.faint },
};

function drawSurfaces(pen: Pen, plane: Plane, frame: Frame, theme: Theme): void {
  for (const [kind, line] of Object.entries(SURFACE_LINES)) {
    pen.strokeStyle = line.colour(theme);
    pen.lineWidth = line.width;
    pen.setLineDash(line.dash);
    pen.beginPath();
    for (const part of plane.parts) {
      if (part.kind !== kind) continue;
      for (let row = part.first; row <= part.last; row++) {
        const [x, y] = [frame.x.at(plane.points[2 * row]), frame.y.at(plane.points[2 * row + 1])];
        if (row === part.first) pen.moveTo(x, y);
        else pen.lineTo(x, y);
      }
    }
    pen.stroke();
  }
  pen.setLineDash([]);
}

/** A circle for an equilibrium, a square for a pseudo-equilibrium; filled if it is stable. */
function drawSign(pen: Pen, x: number, y: number, isPseudo: boolean, stable: boolean | null, theme: Theme): void {
  pen.beginPath();
  if (isPseudo) pen.rect(x - 4.2, y - 4.2, 8.4, 8.4);
  else circle(pen, x, y, 4.8);
  pen.fillStyle = stable ? theme.ink : theme.ground;
  pen.fill();
  pen.strokeStyle = theme.ink;
  pen.lineWidth = 1.5;
  pen.setLineDash(stable === null ? [2, 2] : []);
  pen.stroke();
  pen.setLineDash([]);
}

function drawEquilibrium(
  pen: Pen,
  point: Equilibrium,
  [i, j]: readonly [number, number],
  frame: Frame,
  theme: Theme,
): void {
  if (!point.admissible) return;
  drawSign(pen, frame.x.at(point.y[i]), frame.y.at(point.y[j]), point.surfaces.length > 0, point.stable, theme);
}

function drawStart(pen: Pen, data: PortraitData, frame: Frame, theme: Theme): void {
  const [i, j] = data.axes;
  const [x, y] = [frame.x.at(data.start[i]), frame.y.at(data.start[j])];
  pen.strokeStyle = theme.ink;
  pen.fillStyle = theme.ground;
  pen.lineWidth = 1.4;
  circle(pen, x, y, 5.5);
  pen.fill();
  pen.stroke();
  pen.fillStyle = theme.ink;
  circle(pen, x, y, 1.6);
  pen.fill();
}

function drawMark(pen: Pen, x: number, y: number, theme: Theme): void {
  circle(pen, x, y, 4.5);
  pen.fillStyle = theme.ink;
  pen.fill();
  pen.strokeStyle = theme.ground;
  pen.lineWidth = 1.5;
  pen.stroke();
}

function keyEntries(data: PortraitData, frame: Frame, theme: Theme): KeyEntry[] {
  const entries: KeyEntry[] = [];
  const { plane, run } = data;
  if (data.withModes && run) entries.push(...modeEntries(modesOf(run), data.modes, data.surfaces, theme));
  const kinds = new Set(plane?.parts.map((part) => part.kind));
  for (const [kind, line] of Object.entries(SURFACE_LINES) as [SurfaceKind, SurfaceLine][]) {
    if (kinds.has(kind)) entries.push(lineEntry(line.label, line.colour(theme), line.width, line.dash));
  }
  for (const isPseudo of [false, true]) {
    for (const stable of [true, false, null]) {
      const is = (point: Equilibrium) =>
        point.admissible && point.surfaces.length > 0 === isPseudo && point.stable === stable;
      if (!plane?.equilibria.some(is)) continue;
      const name = isPseudo ? "pseudo-equilibrium" : "equilibrium";
      entries.push({
        label: stable === null ? name : `${stable ? "stable" : "unstable"} ${name}`,
        sample: (pen, x, y) => drawSign(pen, x + SAMPLE / 2, y, isPseudo, stable, theme),
      });
    }
  }
  if (data.cycle) entries.push(lineEntry("cycle", cycleColour(theme), CYCLE_WIDTH));
  if (run && findDwells(run, ...data.axes, frame).length > 0)
    entries.push(dotEntry("at rest, by its duration", theme.muted));
  return entries;
}

/** The picture in a sentence. */
export function describePortrait(data: PortraitData): string {
  const { run, plane, axes, states } = data;
  const plot = `Phase portrait of ${states[axes[0]]} and ${states[axes[1]]}`;
  if (!run) return `${plot}.`;
  const last = (run.t.length - 1) * run.n;
  const at = (offset: number) => axes.map((k) => showNumber(run.y[offset + k], 4)).join(", ");
  const modes = modesOf(run);
  const points = plane?.equilibria.filter((point) => point.admissible) ?? [];
  const slides = run.pieces.filter((piece) => isSliding(piece.mode)).length;
  return (
    `${plot}: ${count(run.pieces.length, "piece")} in ${count(modes.length, "mode")}, ${count(run.switches.length, "switch", "switches")}` +
    (slides ? `, ${slides} of the pieces sliding` : "") +
    (points.length ? `; ${count(points.length, "equilibrium", "equilibria")} in the window` : "") +
    `. The trajectory starts at (${at(0)}) and ends at (${at(last)}). Click, or use the arrow keys, to start elsewhere.`
  );
}
