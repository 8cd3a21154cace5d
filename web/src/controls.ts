/** Sliders with a field for the number beside them, and forms of small fields. */

import { freshId, make } from "./dom.ts";
import { plainNumber, showName, showNumber } from "./numbers.ts";

export interface Quantity {
  readonly element: HTMLElement;
  /** Show a value that has changed elsewhere; a value beyond the range widens it. */
  set(value: number): void;
}

export interface QuantityOptions {
  readonly label: string;
  /** For people who hear the page: `initial value of v`. */
  readonly title: string;
  readonly value: number;
  readonly range: readonly [number, number];
  /** While the slider moves, or a number is typed. */
  input(value: number): void;
  /** When the slider is let go, or the number is complete. */
  done(): void;
}

const POSITIONS = 400;

/** The step of a slider: 1, 2 or 5 times a power of ten, some hundreds of positions over the range. */
export function sliderStep([low, high]: readonly [number, number]): number {
  const raw = (high - low) / POSITIONS;
  if (!(raw > 0)) return 1;
  const power = 10 ** Math.floor(Math.log10(raw));
  return Number((([1, 2, 5, 10].find((factor) => factor * power >= raw) ?? 10) * power).toPrecision(3));
}

/** A slider and a field for one number. */
export function quantity(options: QuantityOptions): Quantity {
  const id = freshId("quantity");
  let [low, high] = options.range;
  const slider = make("input", { type: "range", "aria-label": options.title, tabindex: 0 });
  const field = make("input", { type: "text", inputmode: "decimal", id, autocomplete: "off", spellcheck: "false" });
  const bounds = (value: number) => {
    [low, high] = [Math.min(low, value), Math.max(high, value)];
    slider.min = String(low);
    slider.max = String(high);
    slider.step = String(sliderStep([low, high]));
  };
  const showSlider = (value: number) => {
    bounds(value);
    slider.value = String(value);
    slider.setAttribute("aria-valuetext", `${options.label} = ${showNumber(value)}`);
    slider.style.setProperty("--share", `${(100 * (value - low)) / (high - low || 1)}%`);
  };
  const set = (value: number) => {
    showSlider(value);
    if (document.activeElement !== field) field.value = plainNumber(value);
    field.removeAttribute("aria-invalid");
  };
  slider.addEventListener("input", () => {
    const value = Number(slider.value);
    field.value = plainNumber(value);
    showSlider(value);
    options.input(value);
  });
  slider.addEventListener("change", () => options.done());
  field.addEventListener("input", () => {
    const value = readNumber(field.value);
    field.toggleAttribute("aria-invalid", value === null);
    if (value === null) return;
    showSlider(value);
    options.input(value);
  });
  field.addEventListener("change", () => options.done());
  field.addEventListener("keydown", (event) => {
    const direction = { ArrowUp: 1, ArrowDown: -1 }[event.key];
    const value = readNumber(field.value);
    if (direction === undefined || value === null) return;
    event.preventDefault();
    const next = Number((value + direction * sliderStep([low, high]) * (event.shiftKey ? 10 : 1)).toPrecision(12));
    field.value = plainNumber(next);
    showSlider(next);
    options.input(next);
    options.done();
  });
  set(options.value);
  const element = make(
    "div",
    { class: "quantity" },
    make("label", { for: id, title: options.title }, showName(options.label)),
    field,
    slider,
  );
  return { element, set };
}

/** A number as it is typed: with a comma or a point, a true minus, a fraction `1/3`, `pi`; `null` if it is none. */
export function readNumber(text: string): number | null {
  const plain = text.trim().replaceAll("−", "-").replace(",", ".");
  const [above, below, ...more] = plain.split("/");
  if (more.length > 0) return null;
  const upper = readFactor(above);
  const lower = below === undefined ? 1 : readFactor(below);
  if (upper === null || lower === null || lower === 0) return null;
  return upper / lower;
}

function readFactor(text: string): number | null {
  const match = /^([+-]?)((?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?)?\s*\*?\s*(pi|π)?$/i.exec(text.trim());
  if (!match || (match[2] === undefined && match[3] === undefined)) return null;
  const size = (match[2] === undefined ? 1 : Number(match[2])) * (match[3] === undefined ? 1 : Math.PI);
  const value = match[1] === "-" ? -size : size;
  return Number.isFinite(value) ? value : null;
}

/** A small field for one number with its label. */
export function numberField(
  label: string,
  value: number,
  take: (value: number) => void,
  accept: (value: number) => boolean = () => true,
  title = "",
): HTMLLabelElement {
  const field = make("input", { type: "text", inputmode: "decimal", value: plainNumber(value), autocomplete: "off" });
  field.addEventListener("change", () => {
    const read = readNumber(field.value);
    const isGood = read !== null && accept(read);
    field.toggleAttribute("aria-invalid", !isGood);
    if (isGood) take(read);
  });
  return make("label", { class: "field", ...(title ? { title } : {}) }, make("span", {}, label), field);
}

export function labelled(label: string, control: HTMLElement): HTMLLabelElement {
  return make("label", { class: "field" }, make("span", {}, label), control);
}
