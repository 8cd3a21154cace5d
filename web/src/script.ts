/** A Python script that repeats the run on the screen: letter for letter that of `filippov.app.write_script`. */

import type { Description, Page, State } from "./model.ts";
import { toBase64 } from "./share.ts";

const LINE = 96;
const IMPORTS = {
  math: "import math",
  numpy: "import numpy",
  np: "import numpy as np",
  fl: "import filippov as fl",
};

/** The script; `model` are the bytes that the page was given, for systems without text or name. */
export function writeScript(description: Description, state: State, model: Uint8Array): string {
  const { page, states } = description;
  const params = Object.entries(state.params).map(([name, value]) => `${quoted(name)}: ${python(value)}`);
  const options = [`rtol=${python(state.rtol)}`, `atol=${python(state.atol)}`];
  if (state.method !== "auto") options.push(`method=${quoted(state.method)}`);
  const span = `(${state.t_span.map(python).join(", ")})`;
  const [system, y0, values, sol] = ["system", "y0", "params", "sol"].map((name) => free(name, page));
  const picture = page.axes ? `phase(${sol}, ${page.axes.map((k) => quoted(states[k])).join(", ")})` : `time_series(${sol})`;
  const lines = [
    ...source(description, model, system),
    "",
    `${y0} = [${state.y0.map(python).join(", ")}]`,
    `${values} = {${params.join(", ")}}`,
    `${sol} = ${system}.solve(${span}, ${y0}, ${values}, ${options.join(", ")})`,
    "",
    `print(${sol}.message)`,
    `print(${sol}.switches)`,
    "",
    '# The picture; needs Matplotlib: pip install "filippov[plot]"',
    `ax = fl.plot.${picture}`,
    'ax.figure.savefig("picture.png")',
  ];
  return `${lines.join("\n")}\n`;
}

/** A number as Python prints it, which it reads back to the same bits. */
export function python(value: number): string {
  const [digits, power] = value.toExponential().split("e");
  const exponent = Number(power);
  if (exponent < -4 || exponent >= 16) {
    return `${digits}e${exponent < 0 ? "-" : "+"}${String(Math.abs(exponent)).padStart(2, "0")}`;
  }
  const text = Object.is(value, -0) ? "-0" : String(value);
  return text.includes(".") ? text : `${text}.0`;
}

/** A text as Python prints it. */
function quoted(text: string): string {
  const mark = text.includes("'") && !text.includes('"') ? '"' : "'";
  return mark + text.replaceAll("\\", "\\\\").replaceAll(mark, `\\${mark}`) + mark;
}

/** A name that the functions of the text do not read: they may read one that the text assigns. */
function free(name: string, page: Page): string {
  const isRead = page.text && inText(page) && new RegExp(`(?<!^)(?<![.\\w])${name}\\b`, "m").test(page.text);
  return isRead ? `${name}_` : name;
}

/** The name of the system in the text, or of its function. */
function inText({ function: name, object }: Page): string | null {
  return [object, name].find((given) => given && /^[\p{L}_][\p{L}\p{N}_]*$/u.test(given)) ?? null;
}

/** The lines of a text with the names that a page knows without an import. */
function runnable(given: string): string[] {
  const future = given.match(/^from __future__ import .*/gm) ?? [];
  const text = given.replace(/^from __future__ import .*\n?/gm, "");
  const has = (pattern: string) => new RegExp(pattern, "m").test(text);
  const lines = Object.entries(IMPORTS)
    .filter(([name, line]) => (name === "fl" || has(`\\b${name}\\.`)) && !has(`^${line}\\s*$`))
    .map(([, line]) => line);
  if (has("\\b__name__\\b")) lines.push('__name__ = "model"  # as on the page, which skips what is under "__main__"');
  return [...future, ...lines, text.trimEnd()];
}

function source({ page, states }: Description, model: Uint8Array, system: string): string[] {
  const { reference, text } = page;
  if (reference && /^\w+$/.test(reference)) return ["import filippov as fl", "", `system = fl.problems.get("${reference}").system()`];
  const name = inText(page);
  if (text && name) {
    const names = states.map(quoted).join(", ") + (states.length === 1 ? "," : "");
    const made = name === page.object ? name : `fl.System(${name}, states=(${names}))`;
    return [...runnable(text), "", `${system} = ${made}`];
  }
  return [
    "import base64",
    "",
    "import filippov as fl",
    "",
    "# The system as the page holds it: expressions and numbers, no code.",
    "DATA = (",
    ...toBase64(model)
      .match(new RegExp(`.{1,${LINE}}`, "g"))!
      .map((row) => `    "${row}"`),
    ")",
    "system = fl.System.from_bytes(base64.b64decode(DATA))",
  ];
}
