/** The text of the model: shown always, and read where the page has the reader of Python text. */

import { button, freshId, make } from "./dom.ts";
import { fromBase64 } from "./share.ts";
import { EngineError, readReply } from "./wire.ts";

/** Python text to model bytes. */
export interface TextReader {
  read(text: string): Uint8Array;
}

/** What the reader could not read, and where. */
export class TextError extends Error {
  constructor(
    message: string,
    readonly line: number | null,
    readonly column: number | null,
  ) {
    super(message);
  }
}

interface Exports {
  readonly memory: WebAssembly.Memory;
  alloc(length: number): number;
  free(pointer: number, length: number): void;
  read(pointer: number, length: number): number;
  free_reply(pointer: number): void;
}

const BLOCK_HEAD = 8;

export async function makeTextReader(bytes: Uint8Array): Promise<TextReader> {
  const { instance } = await WebAssembly.instantiate(bytes as Uint8Array<ArrayBuffer>, {});
  const exports = instance.exports as unknown as Exports;
  return {
    read(text) {
      const given = new TextEncoder().encode(text);
      const pointer = exports.alloc(given.length);
      new Uint8Array(exports.memory.buffer, pointer, given.length).set(given);
      const block = exports.read(pointer, given.length);
      exports.free(pointer, given.length);
      const length = new DataView(exports.memory.buffer).getUint32(block, true);
      const reply = new Uint8Array(exports.memory.buffer, block + BLOCK_HEAD, length).slice();
      exports.free_reply(block);
      return toModel(reply);
    },
  };
}

/** The model in a reply of the reader; its error with the place is a `TextError`. */
export function toModel(reply: Uint8Array): Uint8Array {
  const length = new DataView(reply.buffer, reply.byteOffset).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(reply.subarray(4, 4 + length))) as Record<string, unknown>;
  if (header.ok === false) {
    const place = (name: string) => (typeof header[name] === "number" ? (header[name] as number) : null);
    throw new TextError(String(header.error), place("line"), place("column"));
  }
  const { header: good } = readReply(reply);
  if (typeof good.model !== "string") throw new EngineError("the reader of the text returned no model", "reply");
  return fromBase64(good.model);
}

export interface EditorOptions {
  readonly text: string | null;
  /** What stands above the text. */
  readonly label: string;
  /** The reader, or `null` where the page has none. */
  reader(): Promise<TextReader | null>;
  /** Open a model that was read. */
  open(model: Uint8Array): void;
}

/** What stands in the editor before anything is written. */
export const EXAMPLE = `import numpy as np

y0 = [1.0, 2.0]
t_span = (0, 60)

def oscillator(t, x, F=0.4, omega=1/3):
    y, v = x
    return v, -y + np.sin(omega * t) - F * np.sign(v)
`;

export interface Editor {
  readonly element: HTMLElement;
  /** The editor is seen: the reader is fetched now, the first time. */
  show(): void;
}

/** The editor: a text area, a button, and words on what could not be read. */
export function makeEditor(options: EditorOptions): Editor {
  const id = freshId("text");
  const area = make("textarea", { id, spellcheck: "false", rows: 14, autocapitalize: "off", autocomplete: "off" });
  area.value = options.text ?? EXAMPLE;
  const words = make("p", { class: "quiet", role: "status" });
  const go = button("Use this text", () => void use());
  const label = make("label", { for: id }, `${options.label}. Arguments with a default get a slider.`);
  const element = make("div", { class: "editor" }, label, area, make("div", { class: "row" }, go, words));
  let reader: TextReader | null = null;
  let isPrepared = false;

  area.addEventListener("keydown", (event) => {
    if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) void use();
  });

  async function prepare(): Promise<void> {
    reader = await options.reader().catch(() => null);
    if (reader === null) {
      go.hidden = true;
      area.readOnly = true;
      words.textContent = options.text
        ? "This page shows the text; it has no reader of Python text (filippov_text.wasm), so it cannot be edited here."
        : "This page has no reader of Python text (filippov_text.wasm). In Python, fl.explore(system) opens a system of your own.";
      area.hidden = label.hidden = options.text === null;
    } else {
      words.textContent = "Ctrl+Enter reads it. Nothing is sent anywhere, and no Python runs.";
    }
  }

  async function use(): Promise<void> {
    if (reader === null) return;
    try {
      const model = reader.read(area.value);
      words.className = "quiet";
      words.textContent = "";
      options.open(model);
    } catch (error) {
      words.className = "wrong";
      const { line, column, message } = error as TextError;
      words.textContent = line ? `Line ${line}${column ? `, column ${column}` : ""}: ${message}` : message;
      if (line) selectLine(area, line);
    }
  }

  return {
    element,
    show() {
      if (!isPrepared) void prepare();
      isPrepared = true;
    },
  };
}

function selectLine(area: HTMLTextAreaElement, line: number): void {
  const lines = area.value.split("\n");
  const start = lines.slice(0, line - 1).reduce((sum, text) => sum + text.length + 1, 0);
  area.focus();
  area.setSelectionRange(start, start + (lines[line - 1]?.length ?? 0));
}
