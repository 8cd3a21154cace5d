import assert from "node:assert/strict";
import { test } from "node:test";
import { linear, padded, spanOf, ticksOf } from "../src/axes.ts";

test("ticks lie inside at multiples of 1, 2 or 5 times a power of ten", () => {
  for (const [low, high] of [
    [0, 1],
    [-3.7, 12.9],
    [0.4001, 0.4009],
    [1e6, 3e6],
    [-1e-7, 2e-7],
    [188.4, 188.6],
  ] as const) {
    for (const wanted of [2, 5, 9]) {
      const { step, values } = ticksOf([low, high], wanted);
      const mantissa = step / 10 ** Math.floor(Math.log10(step) + 1e-9);
      assert.ok(
        [1, 2, 5, 10].some((m) => Math.abs(mantissa - m) < 1e-6),
        `${step}`,
      );
      assert.ok(
        values.length >= 1 && values.length <= 1.25 * wanted + 1,
        `${values.length} ticks for ${wanted} in ${low}, ${high}`,
      );
      assert.ok(values.every((v) => v >= low - 1e-9 * step && v <= high + 1e-9 * step));
    }
  }
});

test("the texts of ticks differ from one another and stand for their values", () => {
  for (const interval of [
    [0.4001, 0.4009],
    [-2, 2],
    [0, 25000],
    [0, 3e7],
    [-4e-6, 4e-6],
    [1e6, 1.0001e6],
  ] as const) {
    const ticks = ticksOf(interval, 6);
    const texts = ticks.values.map((value) => ticks.show(value));
    assert.equal(new Set(texts).size, texts.length, texts.join(" "));
    texts.forEach((text, k) => {
      assert.ok(
        Math.abs(Number(text.replaceAll("−", "-")) - ticks.values[k]) <= 1e-6 * ticks.step + 1e-15,
        `${text} for ${ticks.values[k]}`,
      );
    });
  }
});

test("zero is written without a sign", () => {
  const ticks = ticksOf([-0.3, 0.3], 6);
  assert.deepEqual(
    ticks.values.map((value) => ticks.show(value)),
    ["−0.3", "−0.2", "−0.1", "0.0", "0.1", "0.2", "0.3"],
  );
});

test("an empty interval has one tick", () => {
  assert.deepEqual(ticksOf([2, 2], 5).values, [2]);
});

test("a scale and its inverse agree, also downwards", () => {
  const scale = linear([-2, 6], [400, 30]);
  assert.equal(scale.at(-2), 400);
  assert.equal(scale.at(6), 30);
  for (const value of [-2, 0, 0.1, 5.9, 100]) assert.ok(Math.abs(scale.back(scale.at(value)) - value) < 1e-12);
});

test("an interval is never empty", () => {
  assert.deepEqual(padded(0, 0, 0.1), [-1, 1]);
  assert.deepEqual(padded(2, 2, 0.1), [1.8, 2.2]);
  assert.deepEqual(padded(Infinity, -Infinity, 0.1), [-1, 1]);
  assert.deepEqual(spanOf([1, 3], 0.5), [0, 4]);
});
