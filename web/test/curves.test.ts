import assert from "node:assert/strict";
import { test } from "node:test";
import { describeBranch, drawBranch } from "../src/branch.ts";
import type { Branch } from "../src/replies.ts";
import { frameIn } from "../src/axes.ts";
import { boundsOf, dwellRadius, findDwells, findJumps, stateAt } from "../src/curves.ts";
import { ModeNumbers } from "../src/modes.ts";
import { boxOf, describePortrait, drawPortrait, fits, type PortraitData } from "../src/portrait.ts";
import { SvgPen } from "../src/recorder.ts";
import { describeSeries, drawSeries, spansOf } from "../src/series.ts";
import { LIGHT } from "../src/theme.ts";
import { stickingRun } from "./made_up.ts";

const FRAME = frameIn([0, 3], [-2, 3], 400, 300, { left: 0, right: 0, top: 0, bottom: 0 });

test("sticking is one dot at its place, with its duration", () => {
  const dwells = findDwells(stickingRun(), 0, 1, FRAME);
  assert.equal(dwells.length, 1);
  assert.equal(dwells[0].duration, 3);
  assert.ok(Math.abs(dwells[0].x - FRAME.x.at(2)) < 1e-9 && Math.abs(dwells[0].y - FRAME.y.at(0)) < 1e-9);
});

test("a piece of sliding that is over soon is no rest, and a slow one is", () => {
  const run = stickingRun();
  const moving = { ...run, t: Float64Array.from([0, 0.5, 1, 1, 1.001, 1.001, 2]), y: run.y.slice() };
  moving.y[8] = 2.003; // moves a little in a very short time
  assert.deepEqual(findDwells(moving, 0, 1, FRAME), []);
  const slow = { ...moving, t: run.t };
  assert.equal(findDwells(slow, 0, 1, FRAME).length, 1);
});

test("the area of a dot is its share of the run", () => {
  const ratio = dwellRadius(4, 10) / dwellRadius(1, 10);
  assert.ok(Math.abs(ratio - 2) < 1e-12);
  assert.ok(dwellRadius(1e-9, 10) > 1, "a short one can be seen");
});

test("rests at one place are one dot", () => {
  const run = stickingRun();
  const twice = { ...run, pieces: [...run.pieces, run.pieces[1]] };
  const dwells = findDwells(twice, 0, 1, FRAME);
  assert.deepEqual(
    dwells.map(({ duration }) => duration),
    [6],
  );
});

test("the state between two points of the curve", () => {
  const run = stickingRun();
  assert.deepEqual(stateAt(run, 0.25), { y: [1.3, 1.5], mode: "+" });
  assert.equal(stateAt(run, 2.5)?.mode, "0");
  assert.equal(stateAt(run, 5.1), null);
});

test("a jump of the state is found, a switch without one is none", () => {
  assert.deepEqual(findJumps(stickingRun()), [[4, 5]]);
});

test("a box holds the run, and is not changed for one that fits", () => {
  const run = stickingRun();
  assert.deepEqual(boundsOf(run), [
    [1, 2],
    [-1, 2],
  ]);
  const box = boxOf(run, [0, 1]);
  assert.ok(fits(run, [0, 1], box));
  assert.ok(!fits(run, [0, 1], { x: [1.2, 3], y: [-2, 3] }), "it leaves the box");
  assert.ok(!fits(run, [0, 1], { x: [-50, 50], y: [-2, 3] }), "it is lost in the box");
});

function portraitData(): PortraitData {
  const run = stickingRun();
  return {
    run,
    kept: [],
    cycle: null,
    plane: {
      parts: [
        { surface: "v", kind: "attracting", first: 0, last: 1 },
        { surface: "v", kind: "repelling", first: 2, last: 3 },
      ],
      points: Float64Array.from([1, 0, 1.5, 0, 1.6, 0, 2, 0]),
      field: Float64Array.from([1.5, 0.5, 1, 0]),
      equilibria: [
        { y: [1.2, 0.5], surfaces: [], stable: false, admissible: true },
        { y: [1.4, 0], surfaces: ["v"], stable: true, admissible: true },
        { y: [1.9, 0.7], surfaces: [], stable: true, admissible: false },
      ],
      instant: null,
      searched: "",
    },
    axes: [0, 1],
    box: boxOf(run, [0, 1]),
    states: ["y", "v"],
    surfaces: ["v"],
    modes: new ModeNumbers(),
    start: [1, 2],
    marked: null,
    withModes: true,
  };
}

test("the portrait as SVG: modes in their colours, parts of the surface, the dot, signs of equilibria, a key", () => {
  const pen = new SvgPen(500, 400, () => "data:,");
  drawPortrait(pen, 500, 400, portraitData(), LIGHT);
  const svg = pen.toString();
  for (const colour of [LIGHT.colours[0], LIGHT.colours[1], LIGHT.attracting, LIGHT.repelling]) {
    assert.ok(svg.includes(`stroke="${colour}"`), colour);
  }
  assert.ok(svg.includes(`fill="${LIGHT.colours[2]}"`), "the dot of sticking");
  for (const text of [
    "attracting",
    "repelling",
    "unstable equilibrium",
    "stable pseudo-equilibrium",
    "v &lt; 0",
    "at rest",
  ]) {
    assert.ok(svg.includes(text), text);
  }
  assert.ok(!svg.includes("NaN") && !svg.includes("undefined"));
  assert.equal(svg.split("<g").length, svg.split("</g>").length);
});

test("the sentence of the portrait counts what is drawn", () => {
  const words = describePortrait(portraitData());
  assert.match(
    words,
    /Phase portrait of y and v: 3 pieces in 3 modes, 2 switches, 1 of the pieces sliding; 2 equilibria/,
  );
  assert.match(words, /starts at \(1, 2\) and ends at \(1, −1\)/);
});

test("the time series has a panel for each state, and the strip has the modes", () => {
  const run = stickingRun();
  const data = {
    run,
    states: ["y", "v"],
    surfaces: ["v"],
    modes: new ModeNumbers(),
    shown: [0, 1],
    window: [0, 5] as const,
    spans: spansOf(run),
    cursor: { t: 2, y: [2, 0] },
  };
  const pen = new SvgPen(600, 400, () => "data:,");
  const time = drawSeries(pen, 600, 400, data, LIGHT);
  const svg = pen.toString();
  assert.ok(time.at(5) > time.at(0));
  for (const text of [">y<", ">v<", ">t<", "v = 0, sliding"]) assert.ok(svg.includes(text), text);
  for (const colour of LIGHT.colours.slice(0, 3)) assert.ok(svg.includes(`fill="${colour}"`), colour);
  assert.ok(!svg.includes("NaN"));
  assert.match(describeSeries(data), /y between 1 and 2, v between −1 and 2; 2 switches/);
});

test("a branch is solid where it is stable and dashed where it is not, with its special points", () => {
  const branch: Branch = {
    n: 2,
    parameter: "F",
    value: Float64Array.from([0, 1, 2, 3]),
    y: new Float64Array(8),
    low: Float64Array.from([-1, 0, -2, 0, -3, 0, -4, 0]),
    high: Float64Array.from([1, 0, 2, 0, 3, 0, 4, 0]),
    stable: Float64Array.from([1, 1, 0, NaN]),
    special: [{ index: 2, value: 2, code: "LP", text: "a fold" }],
    text: "It folds once.",
  };
  const data = { branch, state: 0, labels: ["F", "y"] as const, here: 1.5 };
  const pen = new SvgPen(500, 300, () => "data:,");
  drawBranch(pen, 500, 300, data, LIGHT);
  const svg = pen.toString();
  assert.ok(svg.includes('stroke-width="2.2"') && svg.includes('stroke-dasharray="6 4"') && svg.includes(">LP<"));
  assert.ok(svg.includes("stability not known") && !svg.includes("NaN"));
  assert.match(describeBranch(data), /4 points\. It folds once\. Special points: LP at F = 2\./);
});
