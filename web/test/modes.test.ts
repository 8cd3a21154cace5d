import assert from "node:assert/strict";
import { test } from "node:test";
import { explainMode, modeColour, modeRank, showMode, sortModes } from "../src/modes.ts";
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

test("one surface: the colours of the Python package", () => {
  assert.deepEqual(
    ["+", "-", "0"].map((mode) => modeColour(mode, LIGHT.colours)),
    ["#0072b2", "#e69f00", "#009e73"],
  );
});

test("regions with a common surface never have the same colour, however many surfaces there are", () => {
  for (const m of [1, 2, 5, 12, 40]) {
    for (let k = 0; k < m; k++) {
      const mode = Array.from({ length: m }, (_, j) => ((j * 7 + k) % 3 ? "+" : "-"));
      const across = mode.map((sign, j) => (j === k ? (sign === "+" ? "-" : "+") : sign));
      for (const { colours } of [LIGHT, DARK]) {
        assert.equal(new Set(colours).size, 7);
        assert.notEqual(modeColour(mode.join(""), colours), modeColour(across.join(""), colours));
      }
    }
  }
});

test("modes have names, not codes", () => {
  assert.equal(showMode("+0-"), "+0−");
  assert.equal(explainMode("-", ["v"]), "−  v < 0");
  assert.equal(explainMode("0", ["v"]), "0  v = 0, sliding");
  assert.equal(explainMode("0+", ["v", "w"]), "0+  sliding");
});
