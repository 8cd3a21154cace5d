/** Where the hosts come in: `mount` for all of them, `boot` for a page, `render` for a notebook's widget. */

import style from "./app.css";
import { HttpEngine, CommEngine, type Comm } from "./engine.remote.ts";
import { WASM_KINDS, type Engine } from "./engine.ts";
import { makeTextReader, type TextReader } from "./editor.ts";
import { Front, type Host } from "./front.ts";
import { describe, toDescription, type Description, type State } from "./model.ts";
import { makeEngines, single, type Engines } from "./pool.ts";
import { fromBase64, readFragment, toState, writeFragment } from "./share.ts";
import { showStart, type Problem } from "./start.ts";
import { applyTheme, DARK, LIGHT } from "./theme.ts";
import { EngineError } from "./wire.ts";

export interface Given {
  /** One engine, or engines for quick and for heavy work. */
  readonly engine: Engine | Engines;
  readonly model: Description;
  readonly state?: unknown;
  readonly host?: Partial<Host>;
}

const ALONE: Host = { bytes: null, problem: null, problems: [], address: null, reader: () => Promise.resolve(null) };

/** Put the front into an element. */
export function mount(element: HTMLElement, { engine, model, state, host }: Given): Front {
  const engines = "quick" in engine ? engine : single(engine);
  return new Front(element, engines, model, toState(model, state), { ...ALONE, ...host });
}

/** Say in an element why there is no front. */
export function complain(element: HTMLElement, error: unknown): void {
  element.classList.add("filippov");
  applyTheme(element, window.matchMedia("(prefers-color-scheme: dark)").matches ? DARK : LIGHT);
  const words = document.createElement("p");
  words.className = "complaint";
  words.setAttribute("role", "alert");
  words.textContent = (error as Error).message || String(error);
  element.replaceChildren(words);
}

/** Start on a page: what to show is in the fragment, in the page, or with the local server. */
export async function boot(element: HTMLElement): Promise<void> {
  const home = location.hash; // of the model that the page was opened with
  const shown = element as HTMLElement & { front?: Front | null };
  const open = async () => {
    try {
      const made = await fromAddress(shown, home);
      shown.front?.close();
      shown.front = made();
      document.title = shown.front?.title ?? "filippov";
    } catch (error) {
      shown.front?.close();
      shown.front = null;
      complain(element, error);
    }
  };
  window.addEventListener("hashchange", () => void open());
  await open();
}

/** Make the engines of a model, and what puts its front into the page. */
type Show = (bytes: Uint8Array, problem: string | null, kernel?: Engine | null) => Promise<Make>;
/** Put the front into the page; `null` if there is no model to show. */
type Make = () => Front | null;

/** All that is needed for a front; it is put into the element by the function returned, when all has come. */
async function fromAddress(element: HTMLElement & { front?: Front | null }, home: string): Promise<Make> {
  const fragment = await readFragment(location.hash);
  const problems = await fetchProblems();
  const goTo = (hash: string) => {
    location.hash = hash;
  };
  const openProblem = (name: string) => goTo(name === "" ? home : `p=${encodeURIComponent(name)}`);
  /** A model that was read goes into the address: a reload shows it again, and the way back leads to what was before. */
  const openModel = (model: Uint8Array) => {
    const view = element.front ? { before: element.front.ownStart, place: "model" } : null;
    void writeFragment({ model }, view).then(goTo);
  };
  const common = { problems, address: location.href.split("#")[0], openProblem, openModel, reader: fetchReader };
  const show: Show = async (bytes, problem, kernel = null) => {
    const engines = await makeEngines(await fetchModule(), bytes, kernel);
    const model = await describe(engines.quick);
    const { reference } = model.page;
    const known = problem ?? (problems.some(({ name }) => name === reference) ? reference : null);
    const host = { ...common, bytes, problem: known };
    return () => mount(element, { engine: engines, model, state: fragment.view, host });
  };

  if (fragment.model) return await show(fragment.model, null);
  if (fragment.problem) return await show(await fetchProblem(fragment.problem), fragment.problem);
  if (fragment.token !== null) return await fromServer(element, fragment.token, show);
  const name = document.body.dataset.problem;
  if (name !== undefined) return await show(await fetchProblem(name), name);
  return () => {
    showStart(element, { problems, reader: fetchReader, openProblem, openModel });
    return null;
  };
}

async function fromServer(element: HTMLElement, token: string, show: Show): Promise<Make> {
  const response = await fetch("model", { headers: { "X-Filippov-Token": token } });
  if (response.status !== 200 && response.status !== 204) {
    throw new Error((await response.text()) || `The local server gives no model (${response.status}).`);
  }
  const bytes = response.status === 204 ? null : new Uint8Array(await response.arrayBuffer());
  const asked = new HttpEngine("ask", token, WASM_KINDS);
  const { header } = await asked.ask({ kind: "describe" });
  const kernel = new HttpEngine("ask", token, new Set((header.kinds as string[] | undefined) ?? WASM_KINDS));
  if (bytes !== null && bytes.length > 0) {
    try {
      return await show(bytes, null, kernel);
    } catch (error) {
      // without WebAssembly, or for a model that it does not hold, the kernel computes
      if (error instanceof EngineError && error.code === "trap") throw error;
    }
  }
  const model = toDescription(header);
  return () => mount(element, { engine: kernel, model, host: { bytes } });
}

async function fetchModule(): Promise<WebAssembly.Module> {
  const bytes = await fetchBytes("filippov.wasm");
  if (bytes === null) throw new EngineError("This page has no engine: the file filippov.wasm is missing.", "engine");
  return await WebAssembly.compile(bytes as Uint8Array<ArrayBuffer>);
}

async function fetchProblem(name: string): Promise<Uint8Array> {
  const bytes = /^\w+$/.test(name) ? await fetchBytes(`models/${name}.flp`) : null;
  if (bytes === null) throw new Error(`This page has no model "${name}".`);
  return bytes;
}

async function fetchProblems(): Promise<readonly Problem[]> {
  const bytes = await fetchBytes("models/index.json");
  return bytes === null ? [] : (JSON.parse(new TextDecoder().decode(bytes)) as Problem[]);
}

async function fetchReader(): Promise<TextReader | null> {
  const bytes = await fetchBytes("filippov_text.wasm");
  return bytes === null ? null : await makeTextReader(bytes);
}

/** A file beside the page; `null` if there is none. A page opened from a folder brings its files inside of scripts. */
async function fetchBytes(name: string): Promise<Uint8Array | null> {
  const embedded = (globalThis as { filippovFiles?: Readonly<Record<string, string>> }).filippovFiles?.[name];
  if (embedded !== undefined) return fromBase64(embedded);
  if (location.protocol === "file:") return null;
  const response = await fetch(name).catch(() => null);
  return response?.ok ? new Uint8Array(await response.arrayBuffer()) : null;
}

/** The model of an anywidget, as far as it is used. */
interface WidgetModel extends Comm {
  get(name: string): unknown;
  set(name: string, value: unknown): void;
  save_changes(): void;
  on(name: string, callback: (...values: never[]) => void): void;
  off(name: string, callback: (...values: never[]) => void): void;
}

/** The entry of an anywidget: the front in the output of a cell, with `params`, `y0` and `t_span` in both directions. */
async function render({ model: widget, el }: { model: WidgetModel; el: HTMLElement }): Promise<() => void> {
  const sheet = document.createElement("style");
  sheet.textContent = style;
  const element = document.createElement("div");
  element.setAttribute("data-lm-suppress-shortcuts", "true"); // JupyterLab would take the arrow keys of the sliders
  el.append(sheet, element);
  try {
    const bytes = toBytes(widget.get("model"));
    const engine = await widgetEngine(widget, bytes);
    const model = await describe("quick" in engine ? engine.quick : engine);
    const values = () => ({ params: widget.get("params"), y0: widget.get("y0"), t_span: widget.get("t_span") });
    let last = JSON.stringify(values());
    const front = mount(element, {
      engine,
      model,
      state: values(),
      host: {
        bytes,
        dark: isDarkNotebook(),
        changed(state: State) {
          const now = { params: { ...state.params }, y0: [...state.y0], t_span: [...state.t_span] };
          const text = JSON.stringify(now);
          if (text === last) return;
          last = text;
          for (const [name, value] of Object.entries(now)) widget.set(name, value);
          widget.save_changes();
        },
      },
    });
    Object.assign(element, { front });
    const listen = () => {
      const text = JSON.stringify(values());
      if (text === last) return; // the front's own change comes back
      last = text;
      const { params, y0, t_span } = toState(model, values());
      front.take({ params, y0, t_span });
    };
    const names = ["change:params", "change:y0", "change:t_span"];
    for (const name of names) widget.on(name, listen);
    return () => {
      for (const name of names) widget.off(name, listen);
      front.close();
    };
  } catch (error) {
    complain(element, error);
    return () => undefined;
  }
}

/** What the notebook says of its colours: JupyterLab, VS Code, marimo; `undefined` if it says nothing. */
function isDarkNotebook(): boolean | undefined {
  const { body, documentElement } = document;
  if (body.dataset.jpThemeLight !== undefined) return body.dataset.jpThemeLight === "false";
  if (body.dataset.vscodeThemeKind !== undefined) return body.dataset.vscodeThemeKind !== "vscode-light";
  for (const { classList } of [body, documentElement]) {
    if (classList.contains("dark")) return true;
    if (classList.contains("light")) return false;
  }
  return undefined;
}

async function widgetEngine(widget: WidgetModel, bytes: Uint8Array | null): Promise<Engine | Engines> {
  const wasm = toBytes(widget.get("wasm"));
  const kinds = widget.get("kinds") as string[] | undefined;
  const kernel = new CommEngine(widget, kinds ? new Set(kinds) : WASM_KINDS);
  if (wasm !== null && bytes !== null) {
    try {
      return await makeEngines(await WebAssembly.compile(wasm as Uint8Array<ArrayBuffer>), bytes, kernel);
    } catch {
      // the kernel computes where the notebook allows no WebAssembly
    }
  }
  return kernel;
}

/** The bytes of a trait; `null` if it is empty. */
function toBytes(value: unknown): Uint8Array | null {
  if (!(value instanceof DataView) || value.byteLength === 0) return null;
  return new Uint8Array(value.buffer, value.byteOffset, value.byteLength);
}

export default { render };

const page = typeof document === "undefined" ? null : document.querySelector<HTMLElement>("body.filippov-page > #app");
if (page) void boot(page);
