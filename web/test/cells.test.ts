import assert from "node:assert/strict";
import { test } from "node:test";
import { colourCells, describeBasins, endName, shareOf } from "../src/cells.ts";
import { LIGHT } from "../src/theme.ts";

const BASINS = { rows: 2, columns: 2, label: Float64Array.from([0, 1, 0, -1]), labels: ["ends at rest", "goes round"] };

test("the first row of the cells is the lowest of the picture", () => {
  const { pixels } = colourCells(BASINS, LIGHT);
  const colour = (k: number) => [...pixels.slice(4 * k, 4 * k + 3)];
  assert.deepEqual(colour(2), [0, 114, 178]); // below on the left: the first end
  assert.deepEqual(colour(3), [230, 159, 0]);
  assert.deepEqual(colour(1), [185, 189, 194], "a cell without an end is faint");
});

test("ends have letters and shares, and the sentence has their words", () => {
  assert.deepEqual([0, 25, 26].map(endName), ["A", "Z", "27"]);
  assert.deepEqual(
    [0, 1].map((k) => shareOf(BASINS, k)),
    [50, 25],
  );
  const data = { basins: BASINS, box: { x: [0, 1], y: [0, 1] }, labels: ["y", "v"], start: [0, 0] } as const;
  assert.match(describeBasins(data), /2 by 2 cells\. A, ends at rest: 50 %; B, goes round: 25 %\./);
});
