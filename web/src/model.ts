/** What is known of a model before anything is computed, and the view of it that the user has made. */

import type { Engine } from "./engine.ts";
import type { Header } from "./wire.ts";

export interface Page {
  readonly title: string;
  readonly y0: readonly number[];
  readonly t_span: readonly [number, number];
  readonly rtol: number;
  readonly atol: number;
  readonly method: string;
  readonly ranges: Readonly<Record<string, readonly [number, number]>>;
  readonly axes: readonly [number, number] | null;
  readonly text: string | null;
  readonly reference: string | null;
  /** What the system is in the text: the name of its function, or of a system that the text makes. */
  readonly function: string | null;
  readonly object: string | null;
}

export interface Description {
  readonly n: number;
  readonly states: readonly string[];
  readonly params: readonly { readonly name: string; readonly value: number }[];
  readonly surfaces: readonly string[];
  readonly actions: readonly string[];
  readonly discrete: readonly string[];
  readonly page: Page;
  readonly version: string;
}

export const PLACES = ["switches", "section", "diagram", "basins", "cycles", "model"] as const;
export type Place = (typeof PLACES)[number];

/** The returns to a surface, the states at the ticks of a period, or of the period of a forcing, 2 pi / frequency. */
export type Section =
  | { readonly by: "surface"; readonly surface: string }
  | { readonly by: "period"; readonly period: number; readonly phase: number }
  | { readonly by: "forcing"; readonly frequency: string; readonly phase: number };

/** All that the user can change: what a link carries. */
export interface State {
  params: Record<string, number>;
  y0: number[];
  t_span: [number, number];
  rtol: number;
  atol: number;
  method: string;
  axes: [number, number] | null;
  /** The window of the portrait, `x0, x1, y0, y1`, if the user has chosen one. */
  box: [number, number, number, number] | null;
  /** Starts of further trajectories that stay in the portrait. */
  kept: number[][];
  place: Place;
  section: Section | null;
  skip: number;
  count: number;
  parameter: string | null;
  range: [number, number] | null;
  coordinate: number;
  carry: boolean;
  /** Whether the diagram is drawn over the reciprocal of the parameter; `range` has values of the parameter. */
  reciprocal: boolean;
}

const NO_PAGE: Page = {
  title: "",
  y0: [],
  t_span: [0, 20],
  rtol: 1e-6,
  atol: 1e-9,
  method: "auto",
  ranges: {},
  axes: null,
  text: null,
  reference: null,
  function: null,
  object: null,
};

export async function describe(engine: Engine): Promise<Description> {
  return toDescription((await engine.ask({ kind: "describe" })).header);
}

/** Read the reply to `describe`; what the page leaves open has a default. */
export function toDescription(header: Header): Description {
  const n = Number(header.n ?? 0);
  const given = (header.page ?? {}) as Partial<Page>;
  const known = Object.fromEntries(Object.entries(given).filter(([, value]) => value !== null && value !== undefined));
  const page: Page = { ...NO_PAGE, ...known };
  const states = (header.states ?? []) as string[];
  return {
    n,
    states: Array.from({ length: n }, (_, i) => states[i] ?? `x${i + 1}`),
    params: (header.params ?? []) as Description["params"],
    surfaces: (header.surfaces ?? []) as string[],
    actions: (header.actions ?? []) as string[],
    discrete: (header.discrete ?? []) as string[],
    page: { ...page, y0: Array.from({ length: n }, (_, i) => page.y0[i] ?? 0) },
    version: String(header.version ?? ""),
  };
}

/** The view with which a model opens. */
export function initialState(model: Description): State {
  const { page } = model;
  const first = model.params[0];
  return {
    params: Object.fromEntries(model.params.map(({ name, value }) => [name, value])),
    y0: [...page.y0],
    t_span: [page.t_span[0], page.t_span[1]],
    rtol: page.rtol,
    atol: page.atol,
    method: page.method,
    axes: model.n < 2 ? null : page.axes ? [page.axes[0], page.axes[1]] : [0, 1],
    box: null,
    kept: [],
    place: "switches",
    section: initialSection(model),
    skip: 100,
    count: 100,
    parameter: first?.name ?? null,
    range: first ? rangeOf(model, first.name, first.value) : null,
    coordinate: 0,
    carry: false,
    reciprocal: false,
  };
}

/** A forced system is looked at once in each period of its forcing, another one where it meets its first surface. */
function initialSection(model: Description): Section | null {
  const frequency = frequencyOf(model);
  if (frequency !== null) return { by: "forcing", frequency, phase: 0 };
  return model.surfaces.length > 0 ? { by: "surface", surface: model.surfaces[0] } : null;
}

/** The parameter that is named as frequencies are, if there is one. */
export function frequencyOf(model: Description): string | null {
  return model.params.find(({ name, value }) => /^(omega|w)$/i.test(name) && value > 0)?.name ?? null;
}

/** The range of a slider: the page's, or one around the value that shows its sign and its size. */
export function rangeOf(model: Description, name: string, value: number): [number, number] {
  const given = model.page.ranges[name];
  if (given) return [Math.min(given[0], value), Math.max(given[1], value)];
  if (value === 0) return [-1, 1];
  return value > 0 ? [0, 3 * value] : [3 * value, 0];
}

/** A range in which the parameter has a reciprocal: the model's if it can be, or one up to three times that of the value. */
export function reciprocalRange(range: readonly [number, number], value: number): [number, number] {
  if (hasReciprocal(range)) return [range[1], range[0]];
  return [10 * (value || 1), (value || 1) / 3];
}

export function hasReciprocal([from, to]: readonly [number, number]): boolean {
  return from * to > 0;
}

/** The range of a slider of an initial state. */
export function startRange(model: Description, i: number): [number, number] {
  const given = model.page.ranges[model.states[i]];
  if (given) return [given[0], given[1]];
  const reach = 2 * Math.max(1, ...model.page.y0.map(Math.abs));
  return [-reach, reach];
}

/** The fields that every request about a motion has. */
export function motionRequest(state: State): Record<string, unknown> {
  const { params, y0, t_span, rtol, atol, method } = state;
  return { params, y0, t_span, rtol, atol, method };
}

/** Time enough for all returns: each may take the time that is on the screen, or its period. */
export function longSpan({ t_span, section, params, skip, count }: State): [number, number] {
  const [from, to] = t_span;
  const request = section === null ? {} : sectionRequest(section, params);
  const each = Math.max(Math.abs(to - from), typeof request.period === "number" ? request.period : 0);
  return [from, from + Math.sign(to - from) * each * (skip + count + 2)];
}

/** The section as the engine asks for it, with these parameters. */
export function sectionRequest(section: Section, params: Readonly<Record<string, number>>): Record<string, unknown> {
  switch (section.by) {
    case "surface":
      return { surface: section.surface };
    case "period":
      return { period: section.period, phase: section.phase };
    case "forcing":
      return { period: periodOf(params[section.frequency]), phase: section.phase };
  }
}

/** The same for a sweep: a list of periods if the frequency is what is swept. */
export function sweptSection(
  section: Section,
  params: Readonly<Record<string, number>>,
  parameter: string,
  values: readonly number[],
): Record<string, unknown> {
  if (section.by !== "forcing" || section.frequency !== parameter) return sectionRequest(section, params);
  return { period: values.map(periodOf), phase: section.phase };
}

function periodOf(frequency: number): number {
  return (2 * Math.PI) / frequency;
}
