/** The fields that places below the pictures share: the section, its returns, a parameter with its range, a state. */

import { make, select } from "./dom.ts";
import { labelled, numberField } from "./controls.ts";
import { showExpression, showName } from "./numbers.ts";
import { frequencyOf, type Description, type Section, type State } from "./model.ts";

const INVERSE = "1/";

/** The fields of a section; `changed` is called after each change. */
export function sectionFields(model: Description, state: State, changed: () => void): HTMLElement {
  const element = make("span", { class: "fields" });
  const build = () => {
    const options = optionsOf(model);
    const chosen = state.section;
    const pick = select(
      "where to look at the motion",
      options.map(({ key, label }) => [key, label] as const),
      keyOf(chosen),
      (key) => {
        state.section = options.find((option) => option.key === key)?.section ?? null;
        build();
        changed();
      },
    );
    const parts: HTMLElement[] = [labelled("at", pick)];
    if (chosen?.by === "period") {
      const { phase } = chosen;
      const take = (period: number) => ((state.section = { by: "period", period, phase }), changed());
      parts.push(numberField("period", chosen.period, take, (value) => value > 0));
    }
    if (chosen !== null && chosen.by !== "surface") {
      parts.push(numberField("phase", chosen.phase, (phase) => ((state.section = { ...chosen, phase }), changed())));
    }
    element.replaceChildren(...parts);
  };
  build();
  return element;
}

/** How many returns are left out, and how many are drawn. */
export function returnsFields(state: State, changed: () => void): HTMLElement[] {
  const field = (label: string, name: "skip" | "count", least: number, title: string) => {
    const take = (value: number) => {
      state[name] = Math.round(value);
      changed();
    };
    return numberField(label, state[name], take, (value) => value >= least, title);
  };
  return [
    field("transient", "skip", 0, "returns left out at the start"),
    field("points", "count", 1, "returns that are drawn"),
  ];
}

/** The parameter; with `reciprocals` its reciprocal can be chosen too, as 1/omega for a frequency. */
export function parameterField(
  model: Description,
  state: State,
  changed: (name: string) => void,
  reciprocals = false,
): HTMLElement {
  const names = model.params.map(({ name }) => [name, showName(name)] as const);
  const inverse = names.map(([name, text]) => [`${INVERSE}${name}`, `${INVERSE}${text}`] as const);
  const chosen = (reciprocals && state.reciprocal ? INVERSE : "") + (state.parameter ?? "");
  return labelled(
    "over",
    select("parameter", reciprocals ? [...names, ...inverse] : names, chosen, (key) => {
      state.reciprocal = key.startsWith(INVERSE);
      state.parameter = state.reciprocal ? key.slice(INVERSE.length) : key;
      changed(state.parameter);
    }),
  );
}

/** What the diagram is drawn over, in letters: `omega` or `1/omega`. */
export function overName({ parameter, reciprocal }: State): string {
  return reciprocal ? `${INVERSE}${showName(parameter ?? "")}` : (parameter ?? "");
}

/** The two ends of a range; `accept` tells whether one may be taken. */
export function rangeFields(
  range: readonly [number, number],
  changed: (range: [number, number]) => void,
  accept: (range: [number, number]) => boolean = () => true,
): [HTMLElement, HTMLElement] {
  const ends: [number, number] = [...range];
  const withEnd = (k: 0 | 1, value: number): [number, number] => (k === 0 ? [value, ends[1]] : [ends[0], value]);
  const field = (k: 0 | 1) =>
    numberField(
      k === 0 ? "from" : "to",
      ends[k],
      (value) => {
        ends[k] = value;
        changed([...ends]);
      },
      (value) => accept(withEnd(k, value)),
    );
  return [field(0), field(1)];
}

export function coordinateField(label: string, model: Description, state: State, changed: () => void): HTMLElement {
  const names = model.states.map((name, i) => [String(i), showName(name)] as const);
  return labelled(
    label,
    select("state", names, String(state.coordinate), (value) => {
      state.coordinate = Number(value);
      changed();
    }),
  );
}

/** A form of fields, which are made anew when it is seen: other places may have changed what they show. */
export function fieldsForm(): HTMLFormElement {
  return make("form", { class: "fields", onsubmit: (event: Event) => event.preventDefault() });
}

interface Option {
  readonly key: string;
  readonly label: string;
  readonly section: Section;
}

function optionsOf(model: Description): Option[] {
  const options: Option[] = model.surfaces.map((surface) => ({
    key: `surface ${surface}`,
    label: `${showExpression(surface)} = 0`,
    section: { by: "surface", surface },
  }));
  const frequency = frequencyOf(model);
  if (frequency !== null) {
    options.push({
      key: "forcing",
      label: `each period 2π/${showName(frequency)}`,
      section: { by: "forcing", frequency, phase: 0 },
    });
  }
  options.push({ key: "period", label: "each period of …", section: { by: "period", period: 2 * Math.PI, phase: 0 } });
  return options;
}

function keyOf(section: Section | null): string {
  return section?.by === "surface" ? `surface ${section.surface}` : (section?.by ?? "");
}

/** The section in words: `at the surface v`. */
export function showSection(section: Section | null): string {
  switch (section?.by) {
    case "surface":
      return `at ${showExpression(section.surface)} = 0`;
    case "forcing":
      return `each 2π/${showName(section.frequency)}`;
    case "period":
      return "each period";
    default:
      return "";
  }
}
