/** A branch of cycles or equilibria over a parameter: solid where it is stable, dashed where it is not. */

import { clipTo, drawAxes, frameIn, padded, type Frame, type Interval } from "./axes.ts";
import { drawKey, layKey, lineEntry } from "./key.ts";
import { count, showNumber } from "./numbers.ts";
import { circle, setFont, type Pen } from "./pen.ts";
import type { Branch } from "./replies.ts";
import type { Theme } from "./theme.ts";

export interface BranchData {
  readonly branch: Branch | null;
  readonly state: number;
  readonly labels: readonly [string, string];
  /** Where the parameter stands now. */
  readonly here: number;
}

const SIDES = { left: 66, right: 16, top: 30 };
const BELOW_AXIS = 46;
const LINES = {
  stable: { label: "stable", width: 2.2, dash: [] as number[] },
  unstable: { label: "unstable", width: 1.4, dash: [6, 4] },
  unknown: { label: "stability not known", width: 1, dash: [1.5, 3] },
};
type Stability = keyof typeof LINES;

export function drawBranch(pen: Pen, width: number, height: number, data: BranchData, theme: Theme): Frame {
  const { branch, state } = data;
  const kinds = branch ? (Object.keys(LINES) as Stability[]).filter((kind) => stabilities(branch).includes(kind)) : [];
  const entries = kinds.map((kind) => lineEntry(LINES[kind].label, theme.ink, LINES[kind].width, LINES[kind].dash));
  const key = layKey(pen, entries, width - SIDES.left - SIDES.right);
  const [x, y] = branch
    ? [spanOfAll([branch.value]), spanOfAll(curvesOf(branch, state))]
    : [padded(0, 1, 0), padded(0, 1, 0)];
  const frame = frameIn(x, y, width, height, { ...SIDES, bottom: BELOW_AXIS + key.height });
  drawAxes(pen, frame, { xLabel: data.labels[0], yLabel: data.labels[1] }, theme);
  if (branch) {
    pen.save();
    clipTo(pen, frame);
    for (const curve of curvesOf(branch, state)) drawCurve(pen, branch, curve, frame, theme);
    drawHere(pen, data.here, frame, theme);
    for (const point of branch.special) {
      const top = curvesOf(branch, state).at(-1)![point.index];
      drawSpecial(pen, point.code, frame.x.at(point.value), frame.y.at(top), theme);
    }
    pen.restore();
  }
  drawKey(pen, entries, SIDES.left, height - key.height - 2, width - SIDES.left - SIDES.right, theme);
  return frame;
}

/** The least and the greatest value of a state along the cycle; one curve for equilibria. */
function curvesOf({ n, value, y, low, high }: Branch, state: number): Float64Array[] {
  const column = (all: Float64Array) => Float64Array.from({ length: value.length }, (_, k) => all[k * n + state]);
  return low && high ? [column(low), column(high)] : [column(y)];
}

function stabilities({ stable }: Branch): Stability[] {
  return Array.from(stable, (flag) => (Number.isNaN(flag) ? "unknown" : flag > 0 ? "stable" : "unstable"));
}

function spanOfAll(curves: readonly Float64Array[]): Interval {
  let [low, high] = [Infinity, -Infinity];
  for (const curve of curves) {
    for (const value of curve) {
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  return padded(low, high, 0.06);
}

function drawCurve(pen: Pen, branch: Branch, curve: Float64Array, frame: Frame, theme: Theme): void {
  const kinds = stabilities(branch);
  pen.strokeStyle = theme.ink;
  for (const [kind, line] of Object.entries(LINES)) {
    pen.lineWidth = line.width;
    pen.setLineDash(line.dash);
    pen.beginPath();
    for (let k = 0; k + 1 < curve.length; k++) {
      if (kinds[k] !== kind) continue;
      if (k === 0 || kinds[k - 1] !== kind) pen.moveTo(frame.x.at(branch.value[k]), frame.y.at(curve[k]));
      pen.lineTo(frame.x.at(branch.value[k + 1]), frame.y.at(curve[k + 1]));
    }
    pen.stroke();
  }
  pen.setLineDash([]);
}

function drawHere(pen: Pen, value: number, frame: Frame, theme: Theme): void {
  pen.strokeStyle = theme.accent;
  pen.lineWidth = 1;
  pen.setLineDash([3, 3]);
  pen.beginPath();
  pen.moveTo(frame.x.at(value), frame.y.places[0]);
  pen.lineTo(frame.x.at(value), frame.y.places[1]);
  pen.stroke();
  pen.setLineDash([]);
}

function drawSpecial(pen: Pen, code: string, x: number, y: number, theme: Theme): void {
  circle(pen, x, y, 4);
  pen.fillStyle = theme.repelling;
  pen.fill();
  setFont(pen, 12);
  pen.fillStyle = theme.ink;
  pen.textAlign = "left";
  pen.textBaseline = "alphabetic";
  pen.fillText(code, x + 7, y - 6);
}

/** The picture in a sentence. */
export function describeBranch({ branch, labels }: BranchData): string {
  if (!branch) return "Branch: not followed yet.";
  const special = branch.special.map(({ code, value }) => `${code} at ${labels[0]} = ${showNumber(value, 5)}`);
  return (
    `Branch of ${labels[1]} over ${labels[0]}: ${count(branch.value.length, "point")}. ${branch.text} ` +
    (special.length ? `Special points: ${special.join(", ")}.` : "There are no special points.")
  );
}
