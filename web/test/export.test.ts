import assert from "node:assert/strict";
import { test } from "node:test";
import { curveCsv, pointsCsv, switchesCsv } from "../src/export.ts";
import { initialState, sectionRequest, sweptSection, toDescription } from "../src/model.ts";
import { python, writeScript } from "../src/script.ts";
import { TextError, toModel } from "../src/editor.ts";
import { toBase64 } from "../src/share.ts";
import { packReply } from "../src/wire.ts";
import { friction, FRICTION, stickingRun } from "./made_up.ts";

test("the table of the curve has a row for each point, with all digits", () => {
  const rows = curveCsv(stickingRun(), ["y", "v"]).trim().split("\n");
  assert.equal(rows[0], "t,y,v,mode");
  assert.equal(rows.length, 8);
  assert.equal(rows[2], "0.5,1.6,1,+");
});

test("the table of the switches, with names that need quotes", () => {
  const rows = switchesCsv(stickingRun(), ["y", 'v, "fast"']).trim().split("\n");
  assert.equal(rows[0], 't,kind,surfaces,mode_before,mode_after,y,"v, ""fast"""');
  assert.equal(rows[1], "1,enter_sliding,v,+,0,2,0");
  assert.equal(
    pointsCsv(
      ["a", "b"],
      [
        [1, 2],
        [3, 4.5],
      ],
    ),
    "a,b\n1,3\n2,4.5\n",
  );
});

test("the script of a reference problem", () => {
  const model = friction();
  const state = initialState(model);
  state.params.F = 0.1 + 0.2;
  const script = writeScript(model, state, new Uint8Array());
  assert.match(script, /system = fl\.problems\.get\("dry_friction"\)\.system\(\)/);
  assert.match(script, /'F': 0\.30000000000000004/);
  assert.match(script, /system\.solve\(\(0\.0, 20\.0\), y0, params, rtol=1e-06, atol=1e-09\)/);
});

test("the script of a text, and of bytes", () => {
  const page = {
    ...(FRICTION.page as object),
    reference: null,
    text: "def helper(x):\n    return x\n\ndef fall(t, x):\n    return [-1]\n",
    function: "fall",
  };
  const typed = toDescription({ ...FRICTION, page });
  const written = writeScript(typed, initialState(typed), new Uint8Array());
  assert.match(written, /system = fl\.System\(fall, states=\('y', 'v'\)\)/);
  const bytes = toDescription({ ...FRICTION, page: { ...page, text: null } });
  const model = Uint8Array.from({ length: 300 }, (_, k) => k & 255);
  const script = writeScript(bytes, initialState(bytes), model);
  const packed = [...script.matchAll(/^ {4}"([^"]*)"$/gm)].map((match) => match[1]).join("");
  assert.equal(packed, toBase64(model));
});

test("numbers in Python, to the same bits", () => {
  for (const value of [1, -3, 0.1, 1e-9, 1e21, 5e-324, 1 / 3]) assert.equal(Number(python(value)), value);
  const printed = { 2: "2.0", 1e-4: "0.0001", 1e-5: "1e-05", 1e16: "1e+16", 123456789012345680: "1.2345678901234568e+17" };
  for (const [value, text] of Object.entries(printed)) assert.equal(python(Number(value)), text);
  assert.equal(python(-0), "-0.0");
});

test("a section follows the forcing, also where the frequency is swept", () => {
  const section = { by: "forcing", frequency: "omega", phase: 0.5 } as const;
  assert.deepEqual(sectionRequest(section, { omega: 2 }), { period: Math.PI, phase: 0.5 });
  assert.deepEqual(sweptSection(section, { omega: 2 }, "omega", [1, 2]), {
    period: [2 * Math.PI, Math.PI],
    phase: 0.5,
  });
  assert.deepEqual(sweptSection(section, { omega: 2 }, "F", [1, 2]), { period: Math.PI, phase: 0.5 });
});

test("a forced model is looked at once a period, another one at its surface", () => {
  assert.deepEqual(initialState(friction()).section, { by: "forcing", frequency: "omega", phase: 0 });
  const free = toDescription({ ...FRICTION, params: [] });
  assert.deepEqual(initialState(free).section, { by: "surface", surface: "v" });
  assert.equal(initialState(toDescription({ ok: true, n: 1 })).section, null);
});

test("the reader of the text returns a model, or the place of what it cannot read", () => {
  const model = Uint8Array.of(9, 8, 7);
  assert.deepEqual(toModel(packReply({ ok: true, kind: "read", model: toBase64(model) })), model);
  const failure = packReply({ ok: false, error: "loops are not read", line: 4, column: 5 });
  assert.throws(
    () => toModel(failure),
    (error: TextError) => error.line === 4 && error.column === 5 && /loops/.test(error.message),
  );
});
