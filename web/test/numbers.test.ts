import assert from "node:assert/strict";
import { test } from "node:test";
import { readNumber, sliderStep } from "../src/controls.ts";
import { showBeside, showExpression, showName, showNumber } from "../src/numbers.ts";

test("numbers as they are typed", () => {
  for (const [text, value] of [
    ["1/3", 1 / 3],
    ["-2,5", -2.5],
    ["−4", -4],
    ["2 pi", 2 * Math.PI],
    ["pi/2", Math.PI / 2],
    ["60π", 60 * Math.PI],
    ["1e-3", 1e-3],
    [".5", 0.5],
    ["+7", 7],
  ] as const) {
    assert.equal(readNumber(text), value, text);
  }
  for (const text of ["", "a", "1/0", "1/2/3", "1e999", "--1", "NaN", "1 2"])
    assert.equal(readNumber(text), null, text);
});

test("a slider has some hundreds of positions, at round numbers", () => {
  for (const range of [
    [0, 1.2],
    [-4, 4],
    [0, 376.99],
    [0, 1e-6],
    [-1, 0],
  ] as const) {
    const positions = (range[1] - range[0]) / sliderStep(range);
    assert.ok(positions >= 150 && positions <= 401, `${positions}`);
  }
});

test("numbers as they are shown", () => {
  assert.equal(showNumber(-0.333333333), "−0.333333");
  assert.equal(showNumber(1e300), "1e+300");
  assert.equal(showNumber(NaN), "—");
  assert.equal(showBeside(-2.2e-16, 1), "0");
  assert.equal(showBeside(-2.2e-16, 1e-12), "−2.2e−16");
});

test("names as they are printed", () => {
  assert.equal(showName("omega"), "ω");
  assert.equal(showName("x_12"), "x₁₂");
  assert.equal(showName("position"), "position");
  assert.equal(showName("x[0]"), "x₀");
  assert.equal(showName("x[0] - y"), "x[0] - y");
  assert.equal(showName("x]"), "x]");
  assert.equal(showName("F_s"), "F_s");
});

test("expressions as they are printed", () => {
  assert.equal(showExpression("S - 0.8*T - eps"), "S − 0.8\u2009T − ε");
  assert.equal(showExpression("x[1]**2 + sin(omega*t)"), "x₁² + sin(ω\u2009t)");
  assert.equal(showExpression("x**5"), "x**5");
});
