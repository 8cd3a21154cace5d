/** A Python script that repeats the run on the screen: letter for letter that of `filippov.app.write_script`. */

import type { Description, State } from "./model.ts";
import { toBase64 } from "./share.ts";

const LINE = 96;

/** The script; `model` are the bytes that the page was given, for systems without text or name. */
export function writeScript(description: Description, state: State, model: Uint8Array): string {
  const { page, states } = description;
  const params = Object.entries(state.params).map(([name, value]) => `${quoted(name)}: ${python(value)}`);
  const options = [`rtol=${python(state.rtol)}`, `atol=${python(state.atol)}`];
  if (state.method !== "auto") options.push(`method=${quoted(state.method)}`);
  const span = `(${state.t_span.map(python).join(", ")})`;
  const picture = page.axes ? `phase(sol, ${page.axes.map((k) => quoted(states[k])).join(", ")})` : "time_series(sol)";
  const lines = [
    ...source(description, model),
    "",
    `y0 = [${state.y0.map(python).join(", ")}]`,
    `params = {${params.join(", ")}}`,
    `sol = system.solve(${span}, y0, params, ${options.join(", ")})`,
    "",
    "print(sol.message)",
    "print(sol.switches)",
    "",
    '# The picture; needs Matplotlib: pip install "filippov[plot]"',
    `ax = fl.plot.${picture}`,
    'ax.figure.savefig("picture.png")',
  ];
  return `${lines.join("\n")}\n`;
}

/** The name of the last function that a text defines. */
export function lastFunction(text: string): string | null {
  return [...text.matchAll(/^def\s+([A-Za-z_]\w*)/gm)].at(-1)?.[1] ?? null;
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

function source({ page, states }: Description, model: Uint8Array): string[] {
  const { reference, text } = page;
  if (reference && /^\w+$/.test(reference)) return ["import filippov as fl", "", `system = fl.problems.get("${reference}").system()`];
  const name = text ? lastFunction(text) : null;
  if (text && name) {
    const names = states.map(quoted).join(", ") + (states.length === 1 ? "," : "");
    return ["import filippov as fl", text.trimEnd(), "", `system = fl.System(${name}, states=(${names}))`];
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
