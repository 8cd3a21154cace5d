import { spanOfMost, spanOfPoints } from "../src/cloud.ts";
import assert from "node:assert/strict";
import { test } from "node:test";
import { frameIn } from "../src/axes.ts";
import { countPoints, Points, readColour, shade } from "../src/counts.ts";

const FRAME = frameIn([0, 10], [0, 10], 100, 100, { left: 0, right: 0, top: 0, bottom: 0 });

function pointsOf(x: number[], y: number[]): Points {
  const points = new Points();
  points.add(x, y);
  return points;
}

test("points that are added stay, however many there are", () => {
  const points = new Points();
  for (let k = 0; k < 5000; k += 5) points.add([k, k + 1, k + 2, k + 3, k + 4], [0, 0, 0, 0, k]);
  assert.equal(points.length, 5000);
  assert.ok(points.x.every((value, k) => value === k));
  points.keepWithin(100, 199);
  assert.deepEqual([points.length, points.x[0], points.x[99]], [100, 100, 199]);
  points.clear();
  assert.equal(points.x.length, 0);
});

test("every point inside is counted in its pixel, none outside", () => {
  const many = Array.from({ length: 40_000 }, (_, k) => k);
  const x = many.map((k) => (k % 200) / 20 + 0.01);
  const y = many.map((k) => Math.floor(k / 200) / 20 + 0.01);
  const counts = countPoints(pointsOf([...x, -1, 11, 5, NaN, 5], [...y, 5, 5, 99, 5, NaN]), FRAME, 1);
  assert.deepEqual([counts.width, counts.height, counts.most], [100, 100, 4]);
  assert.equal(
    counts.cells.reduce((sum, n) => sum + n, 0),
    40_000,
  );
});

test("upwards is up, and few points are blocks that can be seen", () => {
  const counts = countPoints(pointsOf([0.05], [9.95]), FRAME, 1);
  assert.equal(counts.cells[0], 1);
  assert.equal(counts.cells.filter((n) => n > 0).length, 4);
});

test("shade grows with the count, and a single point can be seen", () => {
  const cells = Uint32Array.from([0, 1, 10, 10_000]);
  const { pixels } = shade({ width: 4, height: 1, cells, most: 10_000 }, "#102030");
  const opacity = [3, 7, 11, 15].map((k) => pixels[k]);
  assert.equal(opacity[0], 0);
  assert.ok(opacity[1] > 80 && opacity[1] < opacity[2] && opacity[2] < opacity[3], opacity.join(" "));
  assert.deepEqual([...pixels.slice(4, 7)], [16, 32, 48]);
  assert.deepEqual(readColour("#d55e00"), [213, 94, 0]);
});

test("a few points far away do not flatten the picture, points that are many do", () => {
  const near = Float64Array.from({ length: 1000 }, (_, k) => Math.sin(k));
  assert.deepEqual(spanOfMost(near), spanOfPoints(near));
  const withPeak = near.map((value, k) => (k % 100 === 0 ? 1000 : value));
  const [low, high] = spanOfMost(withPeak);
  assert.ok(low < -1 && low > -3 && high > 1 && high < 3);
  const withMany = near.map((value, k) => (k % 5 === 0 ? 1000 : value));
  assert.deepEqual(spanOfMost(withMany), spanOfPoints(withMany));
});
