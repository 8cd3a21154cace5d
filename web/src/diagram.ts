/** The brute-force diagram: the returns to a section over a parameter. It grows while workers compute. */

import type { Frame, Interval } from "./axes.ts";
import { padded } from "./axes.ts";
import { drawCloud, plotWidth, spanOfMost, spanOfPoints, type CloudData } from "./cloud.ts";
import { Points } from "./counts.ts";
import { button, make } from "./dom.ts";
import type { Request } from "./engine.ts";
import { pointsCsv } from "./export.ts";
import { hasReciprocal, longSpan, motionRequest, rangeOf, reciprocalRange, sweptSection } from "./model.ts";
import { count, showName, showNumber } from "./numbers.ts";
import { WorkPanel, wordsOf, type Context, type NumbersFile, type Saveable } from "./panel.ts";
import { Picture } from "./picture.ts";
import { askAll } from "./pool.ts";
import { toDiagramPart } from "./replies.ts";
import {
  coordinateField,
  fieldsForm,
  overName,
  parameterField,
  rangeFields,
  returnsFields,
  sectionFields,
  showSection,
} from "./sections.ts";
import { chunks, coarseToFine, evenly } from "./sweep.ts";

const [FEWEST_VALUES, MOST_VALUES] = [200, 960];
const CHUNK = 6;

/** Where a run begins. */
type Start = NonNullable<ReturnType<typeof toDiagramPart>["end"]>;

/** A part of the plane of the diagram: of what stands on the axes. */
interface Window {
  readonly range: readonly [number, number];
  readonly up: Interval | null;
}

export class DiagramPanel extends WorkPanel {
  readonly element: HTMLElement;
  protected readonly picture: Picture;
  private readonly form = fieldsForm();
  private readonly words = make("p", { class: "quiet", role: "status" });
  private readonly go = button("Draw", () => (this.job.isRunning ? this.job.stop() : this.begin()));
  private readonly back = button("Zoom out", () => this.zoomOut());
  private readonly all = button("Show all", () => this.showAll());
  private readonly points = new Points();
  private readonly earlier: Window[] = [];
  private ends: readonly HTMLElement[] = [];
  private up: Interval | null = null;
  private frame: Frame | null = null;
  private choice: CloudData["choice"] = null;
  private drawnFor = "";
  private done = 0;
  /** The number of values: one for each column of pixels. */
  private total = FEWEST_VALUES;
  private failed = new Map<number, string>();

  constructor(private readonly context: Context) {
    super();
    this.picture = new Picture(
      "diagram",
      (pen, w, h, theme) => void (this.frame = drawCloud(pen, w, h, this.data(), theme)),
      () => context.theme(),
      () => this.sentence(),
    );
    this.back.hidden = true;
    this.all.hidden = true;
    this.element = make(
      "div",
      { class: "panel" },
      this.form,
      make("div", { class: "row" }, this.go, this.back, this.all, this.words),
      this.picture.element,
    );
    this.listen();
  }

  show(): void {
    const { state } = this.context;
    if (state.range !== null && !hasReciprocal(state.range)) state.reciprocal = false;
    this.form.replaceChildren(...this.fields());
    if (this.points.length === 0 && !this.job.isRunning) this.begin();
  }

  update(): void {
    if (this.drawnFor !== "" && this.drawnFor !== this.motionKey() && !this.job.isRunning) {
      this.words.textContent = "The other parameters have changed since this diagram was drawn.";
    }
    this.picture.redraw(); // the line at the parameter's value
  }

  saveables(): Saveable[] {
    if (this.points.length === 0) return [];
    const { width, height } = this.picture;
    const draw: Saveable["draw"] = (pen, w, h, theme) =>
      void drawCloud(pen, w, h, { ...this.data(), resolution: 3, line: null }, theme);
    return [{ name: "diagram", width, height, draw }];
  }

  numbers(): NumbersFile[] {
    if (this.points.length === 0) return [];
    const { model, state } = this.context;
    return [
      {
        name: "diagram",
        text: () => pointsCsv([`${state.reciprocal ? "1/" : ""}${state.parameter}`, model.states[state.coordinate]], [this.points.x, this.points.y]),
      },
    ];
  }

  private fields(): HTMLElement[] {
    const { model, state } = this.context;
    const changed = () => this.begin();
    const carry = make("input", { type: "checkbox", checked: state.carry });
    carry.addEventListener("change", () => {
      state.carry = carry.checked;
      changed();
    });
    const accept = (range: [number, number]) => range[0] !== range[1] && (!state.reciprocal || hasReciprocal(range));
    this.ends = rangeFields(this.range(), (range) => this.setWindow({ range, up: null }), accept);
    const chosen = (name: string) => {
      this.earlier.length = 0;
      const range = rangeOf(model, name, state.params[name]);
      state.range = state.reciprocal ? reciprocalRange(range, state.params[name]) : range;
      this.form.replaceChildren(...this.fields());
      this.setWindow({ range: this.range(), up: null });
    };
    return [
      parameterField(model, state, chosen, true),
      ...this.ends,
      coordinateField("of", model, state, () => {
        this.up = null;
        changed();
      }),
      sectionFields(model, state, changed),
      ...returnsFields(state, changed),
      make("label", { class: "check" }, carry, "start each value where the last ended"),
    ];
  }

  private begin(): void {
    this.points.clear();
    void this.job.start((signal) => this.compute(signal));
  }

  /** Values between those that are there: a part of the range is looked at more closely. */
  private refine(): void {
    const [low, high] = this.range();
    if (this.drawnFor === this.motionKey()) this.points.keepWithin(Math.min(low, high), Math.max(low, high));
    else this.points.clear();
    void this.job.start((signal) => this.compute(signal));
  }

  private async compute(signal: AbortSignal): Promise<void> {
    const { state } = this.context;
    if (state.parameter === null || state.range === null) {
      this.picture.say("This model has no parameter to draw a diagram over.");
      return;
    }
    if (state.section === null) {
      this.picture.say("This model has no surface to look at. Choose a period.");
      return;
    }
    this.failed.clear();
    this.done = 0;
    this.total = Math.min(MOST_VALUES, Math.max(FEWEST_VALUES, plotWidth(this.picture.element.clientWidth)));
    this.drawnFor = this.motionKey();
    this.go.textContent = "Stop";
    this.words.textContent = "";
    this.picture.say(null);
    try {
      await (state.carry ? this.carried(signal) : this.scattered(signal));
      if (this.points.length === 0)
        this.picture.say(this.firstFailure() ?? "There are no returns to this section in this range: choose another one beside “at”.");
    } catch (error) {
      const words = wordsOf(error);
      if (words !== null) {
        if (this.points.length === 0) this.picture.say(words);
        else this.failed.set(NaN, words);
      }
    } finally {
      this.go.textContent = "Draw again";
      this.tell(true);
      this.picture.redraw();
    }
  }

  /** Values in any order, in as many workers as there are. */
  private async scattered(signal: AbortSignal): Promise<void> {
    const values = coarseToFine(this.values());
    const requests = chunks(values, CHUNK).map((part) => this.request(part));
    await askAll(
      this.context.engines.many(),
      requests,
      (reply, request) => this.take(toDiagramPart(reply), request),
      signal,
    );
  }

  /** Values in their order, each from the end of the last. */
  private async carried(signal: AbortSignal): Promise<void> {
    const { state, engines } = this.context;
    let start: Start = { t: state.t_span[0], y: state.y0 };
    for (const part of chunks(this.values(), CHUNK)) {
      const request = this.request(part, start);
      const found = toDiagramPart(await engines.many()[0].ask(request, signal));
      signal.throwIfAborted();
      start = found.end ?? start;
      this.take(found, request);
    }
  }

  /** What stands on the axis for a value of the parameter, and the value for what stands there: each way the same. */
  private onAxis(value: number): number {
    return this.context.state.reciprocal ? 1 / value : value;
  }

  /** The range along the axis. */
  private range(): [number, number] {
    const [from, to] = this.context.state.range ?? [0, 1];
    const tidy = (value: number) => Number(this.onAxis(value).toPrecision(15));
    return [tidy(from), tidy(to)];
  }

  /** The values of the parameter, evenly along the axis. */
  private values(): number[] {
    return evenly(this.range(), this.total).map((value) => this.onAxis(value));
  }

  private request(values: readonly number[], start?: Start): Request {
    const { state } = this.context;
    const [from, to] = longSpan(state);
    const { t, y, memory } = start ?? ({ t: from, y: state.y0 } as Start);
    return {
      kind: "diagram",
      ...motionRequest(state),
      y0: y,
      t_span: [t, t + to - from],
      section: sweptSection(state.section!, state.params, state.parameter!, values),
      skip: state.skip,
      count: state.count,
      parameter: state.parameter,
      values,
      coordinate: state.coordinate,
      carry: state.carry,
      ...(memory && { memory }),
    };
  }

  private take(part: ReturnType<typeof toDiagramPart>, request: Request): void {
    this.points.add(
      part.value.map((value) => this.onAxis(value)),
      part.y,
    );
    for (const { value, message } of part.failures) this.failed.set(value, message);
    this.done += (request.values as number[]).length;
    this.tell();
    this.picture.redraw();
  }

  private tell(isOver = false): void {
    const { state } = this.context;
    const parts = [
      `${this.points.length.toLocaleString("en")} points, ${this.done} of ${this.total} values of ${showName(state.parameter ?? "")}`,
    ];
    if (this.failed.size) parts.push(`${count(this.failed.size, "value")} without an end: ${this.firstFailure()}`);
    const outside = this.outside();
    this.all.hidden = outside === 0;
    if (isOver && outside > 0) parts.push(`${count(outside, "point")} outside of the picture`);
    if (isOver && this.points.length) parts.push("drag a rectangle to look closer");
    this.words.textContent = parts.join(" · ");
  }

  private firstFailure(): string | null {
    for (const [value, message] of this.failed)
      return Number.isNaN(value) ? message : `at ${showName(this.context.state.parameter ?? "")} = ${showNumber(value)}: ${message}`;
    return null;
  }

  private setWindow({ range, up }: Window, isPart = false): void {
    const { state } = this.context;
    if (range[0] === range[1]) return;
    state.range = [this.onAxis(range[0]), this.onAxis(range[1])];
    this.up = up;
    for (const [k, label] of this.ends.entries()) label.querySelector("input")!.value = showPlain(range[k], range);
    this.all.hidden = true;
    this.back.hidden = this.earlier.length === 0;
    if (isPart) this.refine();
    else this.begin();
  }

  private zoomOut(): void {
    const before = this.earlier.pop();
    if (before) this.setWindow(before);
  }

  /** The axis upwards as high as all points need. */
  private showAll(): void {
    this.earlier.push({ range: this.range(), up: this.up });
    this.back.hidden = false;
    this.up = spanOfPoints(this.points.y);
    this.tell(true);
    this.picture.redraw();
  }

  /** How many points lie above or below the picture, where nobody has chosen a part of it. */
  private outside(): number {
    if (this.up !== null || this.points.length === 0) return 0;
    const [low, high] = spanOfMost(this.points.y);
    return this.points.y.reduce((n, value) => n + (value < low || value > high ? 1 : 0), 0);
  }

  private data(): CloudData {
    const { points } = this;
    const { model, state } = this.context;
    const range = this.range();
    const low = Math.min(...range);
    const high = Math.max(...range);
    const here = state.parameter === null ? null : this.onAxis(state.params[state.parameter]);
    return {
      points,
      box: { x: [low, high], y: this.up ?? (points.length ? spanOfMost(points.y) : padded(-1, 1, 0)) },
      labels: [overName(state), model.states[state.coordinate]],
      resolution: this.picture.resolution,
      choice: this.choice,
      line: here,
    };
  }

  private listen(): void {
    const { canvas } = this.picture;
    let from: { x: number; y: number } | null = null;
    const inside = ({ x, y }: { x: number; y: number }) => {
      const { frame } = this;
      if (!frame) return { x, y };
      const keep = (place: number, [a, b]: Interval) => Math.min(Math.max(place, Math.min(a, b)), Math.max(a, b));
      return { x: keep(x, frame.x.places), y: keep(y, frame.y.places) };
    };
    canvas.addEventListener("pointerdown", (event) => {
      if (event.button !== 0 || event.pointerType === "touch") return;
      from = inside(this.picture.place(event));
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!from) return;
      const to = inside(this.picture.place(event));
      this.choice = { x: [from.x, to.x], y: [from.y, to.y] };
      this.picture.redraw();
    });
    canvas.addEventListener("pointerup", (event) => {
      const { frame, choice } = this;
      this.choice = null;
      if (from && frame) {
        if (choice && Math.abs(choice.x[1] - choice.x[0]) > 8) this.zoomTo(frame, choice);
        else this.adopt(frame.x.back(inside(this.picture.place(event)).x));
      }
      from = null;
      this.picture.redraw();
    });
    canvas.addEventListener("pointercancel", () => {
      from = null;
      this.choice = null;
    });
  }

  private zoomTo(frame: Frame, choice: NonNullable<CloudData["choice"]>): void {
    this.earlier.push({ range: this.range(), up: this.up });
    const sorted = (a: number, b: number): [number, number] => (a < b ? [a, b] : [b, a]);
    const isFlat = Math.abs(choice.y[1] - choice.y[0]) < 8;
    const range = sorted(frame.x.back(choice.x[0]), frame.x.back(choice.x[1]));
    this.setWindow(
      { range, up: isFlat ? this.up : sorted(frame.y.back(choice.y[0]), frame.y.back(choice.y[1])) },
      true,
    );
  }

  /** A click takes the value of the parameter over into the pictures above. */
  private adopt(value: number): void {
    const { state } = this.context;
    if (state.parameter === null || state.range === null) return;
    const shown = Number(showPlain(value, this.range()));
    this.context.setParameter(state.parameter, this.onAxis(shown));
  }

  /** All that the diagram depends on and that is not among its own fields. */
  private motionKey(): string {
    const { params, y0, rtol, atol, method, parameter } = this.context.state;
    const others = Object.fromEntries(Object.entries(params).filter(([name]) => name !== parameter));
    return JSON.stringify([others, y0, rtol, atol, method]);
  }

  private sentence(): string {
    const { model, state } = this.context;
    const [low, high] = this.range();
    return (
      `Diagram of ${model.states[state.coordinate]} ${showSection(state.section)} over ${overName(state)} ` +
      `from ${showNumber(low, 5)} to ${showNumber(high, 5)}: ${count(this.points.length, "point")}, ${this.done} of ${this.total} values.`
    );
  }
}

/** A value with the digits that tell it from its neighbours on the screen. */
function showPlain(value: number, [low, high]: readonly [number, number]): string {
  const step = Math.abs(high - low) / 1000;
  const decimals = Math.max(0, Math.ceil(-Math.log10(step)));
  return String(Number(value.toFixed(Math.min(decimals, 15))));
}
