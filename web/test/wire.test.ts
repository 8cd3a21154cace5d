import assert from "node:assert/strict";
import { test } from "node:test";
import { toBasins, toDiagramPart, toPlane } from "../src/replies.ts";
import { EngineError, packReply, readReply } from "../src/wire.ts";
import { column, stickingRun, table } from "./made_up.ts";

test("a packed reply is read back to the bit, wherever it stands in memory", () => {
  const header = { ok: true, kind: "sample", note: "Zeitpunkt − ü" };
  const values = [0.1, -0, Infinity, Number.MIN_VALUE, NaN];
  for (const offset of [0, 1, 5]) {
    const bytes = packReply(header, {
      t: column(values),
      y: table([
        [1, 2],
        [3, 4],
      ]),
    });
    const memory = new Uint8Array(offset + bytes.length);
    memory.set(bytes, offset);
    const reply = readReply(memory.subarray(offset));
    assert.equal(reply.header.note, header.note);
    assert.ok(values.every((value, k) => Object.is(value, reply.table("t").data[k])));
    assert.deepEqual([...reply.table("y").shape], [2, 2]);
    assert.deepEqual([...reply.table("y").data], [1, 2, 3, 4]);
  }
});

test("the arrays begin at a multiple of 8", () => {
  for (const note of ["", "a", "abc", "abcdefg"]) {
    const bytes = packReply({ ok: true, note }, { t: column([7.25]) });
    assert.equal(bytes.length % 8, 0);
    assert.equal(new DataView(bytes.buffer).getFloat64(bytes.length - 8, true), 7.25);
  }
});

test("a failure has the words of the engine", () => {
  const bytes = packReply({ ok: false, error: "y0: 3 values are needed", code: "input" });
  assert.throws(
    () => readReply(bytes),
    (error: EngineError) => error.message === "y0: 3 values are needed" && error.code === "input",
  );
});

test("bytes that are cut off are refused, and what is missing is named", () => {
  const bytes = packReply({ ok: true, kind: "run" }, { t: column([1, 2, 3]) });
  for (let length = 0; length < bytes.length; length++) {
    assert.throws(() => readReply(bytes.subarray(0, length)), EngineError, `${length} of ${bytes.length} bytes`);
  }
  assert.throws(() => readReply(bytes).table("y"), /no array "y"/);
});

test("a run has its curve in pieces and its switches", () => {
  const run = stickingRun();
  assert.equal(run.n, 2);
  assert.deepEqual(
    run.pieces.map(({ mode }) => mode),
    ["+", "0", "-"],
  );
  assert.equal(run.switches[1].kind, "exit_sliding");
  assert.equal(run.evaluations, 9);
});

test("planes, diagrams and basins", () => {
  const parts = [{ surface: "v", kind: "attracting", first: 0, last: 1 }];
  const plane = toPlane(
    readReply(
      packReply(
        { ok: true, parts, note: "forced" },
        {
          points: table([
            [0, 0],
            [1, 0],
          ]),
          field: table([[0, 1, 2, 3]]),
        },
      ),
    ),
    7,
  );
  assert.equal(plane.parts[0].kind, "attracting");
  assert.deepEqual(plane.equilibria, []);
  assert.equal(plane.instant, 7, "a field that depends on the time has its time");
  const header = { ok: true, t: 5, messages: [{ value: 2, message: "too many steps" }] };
  const part = toDiagramPart(
    readReply(packReply(header, { value: column([1, 1]), y: column([3, 4]), end: column([3, 4]) })),
  );
  assert.deepEqual(part.end, { t: 5, y: [3, 4] });
  assert.equal(part.failures[0].message, "too many steps");
  const basins = toBasins(
    readReply(
      packReply(
        { ok: true, labels: ["a", "b"] },
        {
          label: table([
            [0, 1, 1],
            [0, -1, 1],
          ]),
        },
      ),
    ),
  );
  assert.deepEqual([basins.rows, basins.columns], [2, 3]);
  assert.throws(() => toBasins(readReply(packReply({ ok: true }, { label: column([1]) }))), /no table/);
});
