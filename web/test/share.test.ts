import assert from "node:assert/strict";
import { test } from "node:test";
import { initialState } from "../src/model.ts";
import { pack, readFragment, toState, unpack, writeFragment } from "../src/share.ts";
import { friction } from "./made_up.ts";

test("bytes come back from a link, whatever they are", async () => {
  for (const length of [0, 1, 182, 5000]) {
    const bytes = Uint8Array.from({ length }, (_, k) => (k * k * 31 + 7) & 255);
    const text = await pack(bytes);
    assert.match(text, /^[A-Za-z0-9_-]*$/);
    assert.deepEqual(await unpack(text), bytes);
  }
});

test("a link carries the model and the whole view", async () => {
  const model = friction();
  const state = initialState(model);
  state.params.F = 0.123456789012345;
  state.y0 = [1 / 3, -2];
  state.axes = [1, 0];
  state.box = [-1, 1, -2, 2];
  state.kept = [[0, 1]];
  state.place = "diagram";
  state.section = { by: "period", period: 3, phase: 0.5 };
  const bytes = Uint8Array.of(1, 2, 3);
  const read = await readFragment(await writeFragment({ model: bytes }, state));
  assert.deepEqual(read.model, bytes);
  assert.deepEqual(toState(model, read.view), state);
});

test("a problem has a name in the link", async () => {
  const read = await readFragment(await writeFragment({ problem: "dry_friction" }, {}));
  assert.equal(read.problem, "dry_friction");
  assert.equal(read.model, null);
});

test("a token is read, an empty fragment is nothing", async () => {
  assert.equal((await readFragment("#token=abc")).token, "abc");
  const empty = await readFragment("");
  assert.deepEqual([empty.model, empty.problem, empty.token, empty.view], [null, null, null, null]);
});

test("a damaged link is refused by its part", async () => {
  const link = await writeFragment({ model: Uint8Array.from({ length: 400 }, (_, k) => (k * 37) & 255) }, { F: 1 });
  await assert.rejects(readFragment(link.replace(/m=.{20}/, "m=")), /its model cannot be read/);
  await assert.rejects(readFragment("#m=AAAA&s=%%%"), /cannot be read/);
});

test("a part that unpacks to very much is refused", async () => {
  const text = await pack(new Uint8Array(6 << 20));
  assert.ok(text.length < 20_000);
  await assert.rejects(unpack(text), /too large/);
});

test("of a foreign view only what fits the model is taken", () => {
  const model = friction();
  const state = toState(model, {
    params: { F: "1", omega: 3, other: 7, __proto__: { F: 9 } },
    t_span: [5, 5],
    rtol: -1,
    axes: [0, 0],
    place: "elsewhere",
    section: { by: "surface", surface: "no such" },
    kept: [[1, 2]],
    coordinate: 5,
    parameter: "omega",
    range: [0, 2],
    reciprocal: true, // of a range with 0 in it
  });
  const plain = initialState(model);
  const own = { params: { F: 0.4, omega: 3 }, kept: [[1, 2]], parameter: "omega", range: [0, 2] };
  assert.deepEqual(state, { ...plain, ...own });
  assert.ok(toState(model, { parameter: "omega", range: [3, 0.1], reciprocal: true }).reciprocal);
});

test("a start of another length than the model is refused, and that of the model before is left out", () => {
  const model = friction();
  const y0 = [...initialState(model).y0];
  for (const view of [{ y0: [1, 2, 3] }, { y0: [1] }, { kept: [[1, 2], [1]] }]) {
    assert.throws(() => toState(model, view), /a start needs 2 numbers, for y, v; there (is|are) [13]\./);
  }
  assert.throws(() => toState(model, { y0: "abc" }), /there is no list/);
  assert.throws(() => toState(model, { y0: [1, null] }), /a start needs 2 numbers/);
  assert.deepEqual(toState(model, { before: { y0: [1, 2, 3], t_span: [0, 7] } }).y0, y0);
  assert.deepEqual(toState(model, { before: { y0: [1, 2, 3], t_span: [0, 7] } }).t_span, [0, 7]);
  assert.deepEqual(toState(model, { before: { y0: [5, 6] } }).y0, [5, 6]);
});
