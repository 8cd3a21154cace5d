/** A Python script that repeats the run on the screen. */

import type { Description, State } from "./model.ts";
import { toBase64 } from "./share.ts";

const LINE = 96;

/** The script; `model` are the bytes that the page was given, for systems without text or name. */
export function writeScript(description: Description, state: State, model: Uint8Array | null): string {
  const { page } = description;
  const lines = [...source(page.reference, page.text, description.n, model), ""];
  lines.push(`y0 = [${state.y0.map(python).join(", ")}]`);
  const names = Object.entries(state.params).map(([name, value]) => `${JSON.stringify(name)}: ${python(value)}`);
  lines.push(`params = {${names.join(", ")}}`);
  const options = [`rtol=${python(state.rtol)}`, `atol=${python(state.atol)}`];
  if (state.method !== "auto") options.push(`method=${JSON.stringify(state.method)}`);
  const span = `(${state.t_span.map(python).join(", ")})`;
  const given = names.length ? "y0, params" : "y0";
  lines.push(
    `sol = system.solve(${span}, ${given}, ${options.join(", ")})`,
    "",
    "print(sol.message)",
    "print(sol.switches)",
  );
  return `${lines.join("\n")}\n`;
}

/** The name of the last function that a text defines. */
export function lastFunction(text: string): string | null {
  return [...text.matchAll(/^def\s+([A-Za-z_]\w*)/gm)].at(-1)?.[1] ?? null;
}

/** A number as Python reads it back to the same bits. */
export function python(value: number): string {
  const text = String(value);
  return /^-?\d+$/.test(text) ? `${text}.0` : text;
}

function source(reference: string | null, text: string | null, n: number, model: Uint8Array | null): string[] {
  if (reference)
    return ["import filippov as fl", "", `system = fl.problems.get(${JSON.stringify(reference)}).system()`];
  const name = text ? lastFunction(text) : null;
  if (text && name) return ["import filippov as fl", text.trimEnd(), "", `system = fl.System(${name}, n=${n})`];
  if (!model) {
    return [
      "import filippov as fl",
      "",
      "# The function lives in the program that opened this page: `system` is its system.",
    ];
  }
  const packed = toBase64(model);
  const rows = packed.match(new RegExp(`.{1,${LINE}}`, "g")) ?? [""];
  return [
    "import base64",
    "",
    "import filippov as fl",
    "",
    "# The system as the page holds it: traced expressions, no code.",
    "DATA = (",
    ...rows.map((row) => `    "${row}"`),
    ")",
    "system = fl.System.from_bytes(base64.b64decode(DATA))",
  ];
}
