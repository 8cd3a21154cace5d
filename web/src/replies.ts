/** The replies of the engine as the front uses them. Names are those of the requests. */

import { EngineError, type Reply } from "./wire.ts";

/** A part of the motion with one mode: rows `first` to `last`, both included, of the curve. */
export interface Piece {
  readonly mode: string;
  readonly first: number;
  readonly last: number;
  readonly kind: string;
}

export interface Switch {
  readonly t: number;
  readonly kind: string;
  readonly surfaces: readonly string[];
  readonly from: string;
  readonly to: string;
  readonly y: readonly number[];
  readonly note?: string;
  readonly kink?: boolean;
}

export interface Notice {
  readonly t?: number;
  readonly code?: string;
  readonly message: string;
}

/** A run, as a curve in pieces. `y` holds rows of `n` states. */
export interface Run {
  readonly n: number;
  readonly t: Float64Array;
  readonly y: Float64Array;
  readonly pieces: readonly Piece[];
  readonly switches: readonly Switch[];
  readonly status: string;
  readonly message: string;
  readonly success: boolean;
  readonly warnings: readonly Notice[];
  readonly steps: number;
  readonly evaluations: number;
}

export type SurfaceKind = "crossing" | "attracting" | "repelling" | "unknown";

export interface SurfacePart {
  readonly surface: string;
  readonly kind: SurfaceKind;
  readonly first: number;
  readonly last: number;
}

export interface Equilibrium {
  readonly y: readonly number[];
  readonly surfaces: readonly string[];
  readonly stable: boolean | null;
  readonly admissible: boolean;
}

/** The plane of two states: surfaces in parts, arrows `x, y, dx, dy`, equilibria. */
export interface Plane {
  readonly parts: readonly SurfacePart[];
  readonly points: Float64Array;
  readonly field: Float64Array;
  readonly equilibria: readonly Equilibrium[];
  /** The time of the field, if the field depends on it; such a plane has no equilibria. */
  readonly instant: number | null;
  /** How equilibria were looked for, in words. */
  readonly searched: string;
}

/** Returns to a section: `y` holds rows of `n` states. */
export interface Returns {
  readonly n: number;
  readonly t: Float64Array;
  readonly y: Float64Array;
  readonly message: string;
  readonly success: boolean;
}

/** Points of a diagram, the state at their end, and what went wrong at which values. */
export interface DiagramPart {
  readonly value: Float64Array;
  readonly y: Float64Array;
  readonly end: { readonly t: number; readonly y: readonly number[]; readonly memory?: readonly number[] } | null;
  readonly failures: readonly { readonly value: number; readonly message: string }[];
}

export interface Basins {
  readonly rows: number;
  readonly columns: number;
  readonly label: Float64Array;
  readonly labels: readonly string[];
}

/** A limit cycle: the run over one period, and what is known of it. */
export interface Cycle {
  readonly run: Run;
  readonly period: number;
  readonly multipliers: readonly (readonly [number, number])[];
  readonly stable: boolean | null;
  readonly text: string;
}

/** A branch over a parameter; `y`, `low`, `high` hold rows of `n` states, `stable` 1, 0, or NaN. */
export interface Branch {
  readonly n: number;
  readonly parameter: string;
  readonly value: Float64Array;
  readonly y: Float64Array;
  readonly low: Float64Array | null;
  readonly high: Float64Array | null;
  readonly stable: Float64Array;
  readonly special: readonly {
    readonly index: number;
    readonly value: number;
    readonly code: string;
    readonly text: string;
  }[];
  readonly text: string;
}

export function toRun(reply: Reply): Run {
  const header = reply.header;
  const y = reply.table("y");
  return {
    n: y.shape[1] ?? 1,
    t: reply.table("t").data,
    y: y.data,
    pieces: (header.pieces ?? []) as Piece[],
    switches: (header.switches ?? []) as Switch[],
    status: String(header.status ?? ""),
    message: String(header.message ?? ""),
    success: header.success !== false,
    warnings: ((header.warnings ?? []) as (Notice | string)[]).map(toNotice),
    steps: Number(header.steps ?? 0),
    evaluations: Number(header.nfev ?? 0),
  };
}

/** `t` is the time that was asked for. */
export function toPlane(reply: Reply, t: number): Plane {
  const header = reply.header;
  return {
    parts: (header.parts ?? []) as SurfacePart[],
    points: reply.table("points").data,
    field: reply.table("field").data,
    equilibria: (header.equilibria ?? []) as Equilibrium[],
    searched: String(header.searched ?? ""),
    instant: header.note ? t : null, // the note says that the field depends on the time
  };
}

export function toReturns(reply: Reply): Returns {
  const y = reply.table("y");
  const { message, success } = reply.header;
  return {
    n: y.shape[1] ?? 1,
    t: reply.table("t").data,
    y: y.data,
    message: String(message ?? ""),
    success: success !== false,
  };
}

export function toDiagramPart(reply: Reply): DiagramPart {
  const memory = reply.has("memory") && { memory: [...reply.table("memory").data] };
  return {
    value: reply.table("value").data,
    y: reply.table("y").data,
    end: reply.has("end") ? { t: Number(reply.header.t), y: [...reply.table("end").data], ...memory } : null,
    failures: (reply.header.messages ?? []) as DiagramPart["failures"],
  };
}

export function toBasins(reply: Reply): Basins {
  const { data, shape } = reply.table("label");
  if (shape.length !== 2) throw new EngineError("the labels of the basins are no table", "reply");
  return { rows: shape[0], columns: shape[1], label: data, labels: (reply.header.labels ?? []) as string[] };
}

export function toCycle(reply: Reply): Cycle {
  const { period, multipliers, stable, text } = reply.header;
  return {
    run: toRun(reply),
    period: Number(period),
    multipliers: (multipliers ?? []) as Cycle["multipliers"],
    stable: (stable ?? null) as boolean | null,
    text: String(text ?? ""),
  };
}

const END = "EP"; // the ends of a branch: its sentence has them

export function toBranch(reply: Reply): Branch {
  const y = reply.table("y");
  const optional = (name: string) => (reply.has(name) ? reply.table(name).data : null);
  return {
    n: y.shape[1] ?? 1,
    parameter: String(reply.header.parameter ?? ""),
    value: reply.table("value").data,
    y: y.data,
    low: optional("low"),
    high: optional("high"),
    stable: reply.table("stable").data,
    special: ((reply.header.special ?? []) as Branch["special"]).filter(({ code }) => code !== END),
    text: String(reply.header.text ?? ""),
  };
}

function toNotice(given: Notice | string): Notice {
  return typeof given === "string" ? { message: given } : given;
}
