import assert from "node:assert/strict";
import { test } from "node:test";
import { explainMode, ModeNumbers, modeRank, showMode, sortModes } from "../src/modes.ts";
import { DARK, LIGHT } from "../src/theme.ts";

/** All modes of m surfaces, sorted as the Python package sorts them: by codimension, then + before 0 before -. */
function allModes(m: number): string[] {
  let modes = [""];
  for (let k = 0; k < m; k++) modes = modes.flatMap((mode) => ["+", "0", "-"].map((sign) => mode + sign));
  return sortModes(modes);
}

test("the rank of a mode is its place among all", () => {
  for (const m of [1, 2, 3, 4]) {
    allModes(m).forEach((mode, place) => {
      for (const modulus of [7, 6, 5]) assert.equal(modeRank(mode, modulus), place % modulus, mode);
    });
  }
});

test("one surface: the colours of the Python package, whatever came first", () => {
  const numbers = new ModeNumbers();
  numbers.note(["0", "-"]);
  assert.deepEqual(
    ["+", "-", "0"].map((mode) => numbers.colour(mode, LIGHT)),
    ["#0072b2", "#e69f00", "#009e73"],
  );
});

test("modes in one picture never share a colour: 21 have one of their own, the rest the faint ink", () => {
  const modes = allModes(4);
  for (const theme of [LIGHT, DARK]) {
    const numbers = new ModeNumbers();
    numbers.note(modes.slice(0, 21));
    const colours = modes.slice(0, 21).map((mode) => numbers.colour(mode, theme));
    assert.equal(new Set(colours).size, 21);
    for (const mode of modes.slice(21)) assert.equal(numbers.colour(mode, theme), theme.faint);
    // others that come later change none of them
    assert.deepEqual(
      modes.slice(0, 21).map((mode) => numbers.colour(mode, theme)),
      colours,
    );
  }
});

test("modes have names, not codes", () => {
  assert.equal(showMode("+0-"), "+0−");
  assert.equal(explainMode("-", ["v"]), "−  v < 0");
  assert.equal(explainMode("0", ["v"]), "0  v = 0, sliding");
  assert.equal(explainMode("0+", ["v", "w"]), "0+  sliding");
});
