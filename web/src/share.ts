/** Links that carry a model and a view in the fragment: nothing is sent to a server. */

import type { Description, State } from "./model.ts";
import { hasReciprocal, initialState, PLACES } from "./model.ts";
import { count, showName } from "./numbers.ts";

/** What the fragment of an address holds. */
export interface Fragment {
  readonly model: Uint8Array | null;
  readonly problem: string | null;
  readonly token: string | null;
  readonly view: unknown;
}

/** So many trajectories stay in the portrait at most. */
export const MOST_KEPT = 24;

const LARGEST = 4 << 20; // bytes of an unpacked part: a link is not a way to fill the memory

export async function writeFragment(what: { model?: Uint8Array; problem?: string }, view: unknown): Promise<string> {
  const parts = [
    what.problem !== undefined
      ? `p=${encodeURIComponent(what.problem)}`
      : `m=${await pack(what.model ?? new Uint8Array())}`,
    `s=${await pack(new TextEncoder().encode(JSON.stringify(view)))}`,
  ];
  return `#${parts.join("&")}`;
}

/** Read a fragment. Parts that cannot be read are an `Error` that names the part. */
export async function readFragment(fragment: string): Promise<Fragment> {
  const parts = new Map<string, string>();
  for (const part of fragment.replace(/^#/, "").split("&")) {
    const at = part.indexOf("=");
    if (at > 0) parts.set(part.slice(0, at), part.slice(at + 1));
  }
  const [model, view] = [parts.get("m"), parts.get("s")];
  const problem = parts.get("p");
  return {
    model: model === undefined ? null : await named("model", unpack(model)),
    problem: problem === undefined ? null : decodeURIComponent(problem),
    token: parts.get("token") ?? null,
    view: view === undefined ? null : JSON.parse(new TextDecoder().decode(await named("view", unpack(view)))),
  };
}

async function named<T>(part: string, work: Promise<T>): Promise<T> {
  try {
    return await work;
  } catch (error) {
    throw new Error(`The link is damaged: its ${part} cannot be read (${(error as Error).message}).`);
  }
}

/** Deflate bytes and write them with letters that an address may hold. */
export async function pack(bytes: Uint8Array): Promise<string> {
  return toBase64Url(await through(bytes, new CompressionStream("deflate-raw")));
}

export async function unpack(text: string): Promise<Uint8Array> {
  return await through(fromBase64Url(text), new DecompressionStream("deflate-raw"));
}

async function through(bytes: Uint8Array, stream: CompressionStream | DecompressionStream): Promise<Uint8Array> {
  const writer = stream.writable.getWriter();
  // both ends at once: a stream waits for its reader; a fault of the writer is that of the reader too
  const written = writer
    .write(bytes as Uint8Array<ArrayBuffer>)
    .then(() => writer.close())
    .catch(() => undefined);
  const chunks: Uint8Array[] = [];
  let size = 0;
  for (const reader = stream.readable.getReader(); ;) {
    const { done, value } = await reader.read();
    if (done) break;
    size += value.length;
    if (size > LARGEST) throw new Error("it is too large");
    chunks.push(value);
  }
  await written;
  const whole = new Uint8Array(size);
  let place = 0;
  for (const chunk of chunks) {
    whole.set(chunk, place);
    place += chunk.length;
  }
  return whole;
}

export function toBase64(bytes: Uint8Array): string {
  let text = "";
  for (const byte of bytes) text += String.fromCharCode(byte);
  return btoa(text);
}

export function fromBase64(text: string): Uint8Array {
  return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
}

function toBase64Url(bytes: Uint8Array): string {
  return toBase64(bytes).replaceAll("+", "-").replaceAll("/", "_").replace(/=+$/, "");
}

function fromBase64Url(text: string): Uint8Array {
  return fromBase64(text.replaceAll("-", "+").replaceAll("_", "/"));
}

/**
 * A state from a view that a link carries. Only what the model has, and only numbers that are finite, are taken
 * over: a link is written by somebody.
 */
export function toState(model: Description, view: unknown): State {
  const state = initialState(model);
  if (typeof view !== "object" || view === null) return state;
  const given = view as Record<string, unknown>;
  if (isRecord(given.params)) {
    for (const name of Object.keys(state.params)) {
      const value = given.params[name];
      if (isNumber(value)) state.params[name] = value;
    }
  }
  const { before } = given; // start and time of the model that was there before: a model with other states has its own
  const { y0, t_span } = isRecord(before) ? { ...before, y0: ofLength(before.y0, model.n) } : given;
  if (y0 !== undefined) state.y0 = toStart(model, y0);
  if (isNumbers(t_span, 2) && t_span[0] !== t_span[1]) state.t_span = [t_span[0], t_span[1]];
  for (const name of ["rtol", "atol"] as const) {
    const value = given[name];
    if (isNumber(value) && value > 0) state[name] = value;
  }
  if (typeof given.method === "string") state.method = given.method;
  if (
    isNumbers(given.axes, 2) &&
    given.axes.every((k) => Number.isInteger(k) && k >= 0 && k < model.n) &&
    given.axes[0] !== given.axes[1]
  ) {
    state.axes = [given.axes[0], given.axes[1]];
  }
  if (isNumbers(given.box, 4) && given.box[0] < given.box[1] && given.box[2] < given.box[3]) {
    state.box = [given.box[0], given.box[1], given.box[2], given.box[3]];
  }
  if (Array.isArray(given.kept)) state.kept = given.kept.slice(0, MOST_KEPT).map((start) => toStart(model, start));
  const place = PLACES.find((name) => name === given.place);
  if (place) state.place = place;
  if (typeof given.parameter === "string" && given.parameter in state.params) state.parameter = given.parameter;
  if (isNumbers(given.range, 2) && given.range[0] !== given.range[1]) state.range = [given.range[0], given.range[1]];
  if (
    isNumber(given.coordinate) &&
    Number.isInteger(given.coordinate) &&
    given.coordinate >= 0 &&
    given.coordinate < model.n
  ) {
    state.coordinate = given.coordinate;
  }
  for (const name of ["skip", "count"] as const) {
    const value = given[name];
    if (isNumber(value) && value >= 0) state[name] = Math.round(value);
  }
  if (typeof given.carry === "boolean") state.carry = given.carry;
  state.reciprocal = given.reciprocal === true && state.range !== null && hasReciprocal(state.range);
  state.section = toSection(model, given.section) ?? state.section;
  return state;
}

/** A start that a link carries: a link with that of another model is refused. */
function toStart(model: Description, given: unknown): number[] {
  if (isNumbers(given, model.n)) return [...given];
  const found = Array.isArray(given) ? `there ${given.length === 1 ? "is" : "are"} ${given.length}` : "there is no list";
  const names = model.states.map(showName).join(", ");
  throw new Error(`The link is damaged: a start needs ${count(model.n, "number")}, for ${names}; ${found}.`);
}

function ofLength(value: unknown, length: number): unknown {
  return Array.isArray(value) && value.length === length ? value : undefined;
}

function toSection(model: Description, given: unknown): State["section"] {
  if (!isRecord(given)) return null;
  const phase = isNumber(given.phase) ? given.phase : 0;
  if (given.by === "surface" && typeof given.surface === "string" && model.surfaces.includes(given.surface)) {
    return { by: "surface", surface: given.surface };
  }
  if (given.by === "period" && isNumber(given.period) && given.period > 0)
    return { by: "period", period: given.period, phase };
  if (given.by === "forcing" && model.params.some(({ name }) => name === given.frequency)) {
    return { by: "forcing", frequency: given.frequency as string, phase };
  }
  return null;
}

function isRecord(value: unknown): value is Record<string, unknown> {
  return typeof value === "object" && value !== null && !Array.isArray(value);
}

function isNumber(value: unknown): value is number {
  return typeof value === "number" && Number.isFinite(value);
}

function isNumbers(value: unknown, length: number): value is number[] {
  return Array.isArray(value) && value.length === length && value.every(isNumber);
}
