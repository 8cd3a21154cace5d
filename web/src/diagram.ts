/** The brute-force diagram: the returns to a section over a parameter. It grows while workers compute. */

import type { Frame, Interval } from "./axes.ts";
import { padded } from "./axes.ts";
import { drawCloud, plotWidth, spanOfPoints, type CloudData } from "./cloud.ts";
import { Points } from "./counts.ts";
import { button, make } from "./dom.ts";
import type { Request } from "./engine.ts";
import { pointsCsv } from "./export.ts";
import { Job } from "./job.ts";
import { longSpan, motionRequest, rangeOf, sweptSection } from "./model.ts";
import { count, showNumber } from "./numbers.ts";
import { wordsOf, type Context, type NumbersFile, type Panel, type Saveable } from "./panel.ts";
import { Picture } from "./picture.ts";
import { askAll } from "./pool.ts";
import { toDiagramPart } from "./replies.ts";
import {
  coordinateField,
  fieldsForm,
  parameterField,
  rangeFields,
  returnsFields,
  sectionFields,
  showSection,
} from "./sections.ts";
import { chunks, coarseToFine, evenly } from "./sweep.ts";

const [FEWEST_VALUES, MOST_VALUES] = [200, 960];
const CHUNK = 6;

interface Window {
  readonly range: readonly [number, number];
  readonly up: Interval | null;
}

export class DiagramPanel implements Panel {
  readonly element: HTMLElement;
  private readonly picture: Picture;
  private readonly form = fieldsForm();
  private readonly words = make("p", { class: "quiet", role: "status" });
  private readonly go = button("Draw", () => (this.job.isRunning ? this.job.stop() : this.begin()));
  private readonly back = button("Zoom out", () => this.zoomOut());
  private readonly points = new Points();
  private readonly earlier: Window[] = [];
  private ends: readonly HTMLElement[] = [];
  private up: Interval | null = null;
  private frame: Frame | null = null;
  private choice: CloudData["choice"] = null;
  private readonly job = new Job();
  private drawnFor = "";
  private done = 0;
  /** The number of values: one for each column of pixels. */
  private total = FEWEST_VALUES;
  private failed = new Map<number, string>();

  constructor(private readonly context: Context) {
    this.picture = new Picture(
      "diagram",
      (pen, w, h, theme) => void (this.frame = drawCloud(pen, w, h, this.data(), theme)),
      () => context.theme(),
      () => this.sentence(),
    );
    this.back.hidden = true;
    this.element = make(
      "div",
      { class: "panel" },
      this.form,
      make("div", { class: "row" }, this.go, this.back, this.words),
      this.picture.element,
    );
    this.listen();
  }

  show(): void {
    this.form.replaceChildren(...this.fields());
    if (this.points.length === 0 && !this.job.isRunning) this.begin();
  }

  hide(): void {}

  update(): void {
    if (this.drawnFor !== "" && this.drawnFor !== this.motionKey() && !this.job.isRunning) {
      this.words.textContent = "The other parameters have changed since this diagram was drawn.";
    }
    this.picture.redraw(); // the line at the parameter's value
  }

  redraw(): void {
    this.picture.redraw();
  }

  settled(): Promise<void> {
    return this.job.settled();
  }

  close(): void {
    this.job.stop();
    this.picture.close();
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
        text: () => pointsCsv([state.parameter ?? "", model.states[state.coordinate]], [this.points.x, this.points.y]),
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
    this.ends = rangeFields(state, (range) => this.setWindow({ range, up: null }));
    return [
      parameterField(model, state, (name) => {
        this.earlier.length = 0;
        this.setWindow({ range: rangeOf(model, name, state.params[name]), up: null });
      }),
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
    const [low, high] = this.context.state.range!;
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
        this.picture.say(this.firstFailure() ?? "There are no returns to this section in this range.");
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
    const values = coarseToFine(evenly(this.context.state.range!, this.total));
    const requests = chunks(values, CHUNK).map((part) => this.request(part, this.context.state.y0));
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
    let start = [...state.y0];
    for (const part of chunks(evenly(state.range!, this.total), CHUNK)) {
      const request = this.request(part, start);
      const found = toDiagramPart(await engines.many()[0].ask(request, signal));
      signal.throwIfAborted();
      if (found.end && found.end.every(Number.isFinite)) start = [...found.end];
      this.take(found, request);
    }
  }

  private request(values: readonly number[], y0: readonly number[]): Request {
    const { state } = this.context;
    return {
      kind: "diagram",
      ...motionRequest(state),
      y0,
      t_span: longSpan(state),
      section: sweptSection(state.section!, state.params, state.parameter!, values),
      skip: state.skip,
      count: state.count,
      parameter: state.parameter,
      values,
      coordinate: state.coordinate,
      carry: state.carry,
    };
  }

  private take(part: ReturnType<typeof toDiagramPart>, request: Request): void {
    this.points.add(part.value, part.y);
    for (const { value, message } of part.failures) this.failed.set(value, message);
    this.done += (request.values as number[]).length;
    this.tell();
    this.picture.redraw();
  }

  private tell(isOver = false): void {
    const { state } = this.context;
    const parts = [
      `${this.points.length.toLocaleString("en")} points, ${this.done} of ${this.total} values of ${state.parameter}`,
    ];
    if (this.failed.size) parts.push(`${count(this.failed.size, "value")} without an end: ${this.firstFailure()}`);
    if (isOver && this.points.length) parts.push("drag a rectangle to look closer");
    this.words.textContent = parts.join(" · ");
  }

  private firstFailure(): string | null {
    for (const [value, message] of this.failed)
      return Number.isNaN(value) ? message : `at ${this.context.state.parameter} = ${showNumber(value)}: ${message}`;
    return null;
  }

  private setWindow({ range, up }: Window, isPart = false): void {
    const { state } = this.context;
    if (range[0] === range[1]) return;
    state.range = [range[0], range[1]];
    this.up = up;
    for (const [k, label] of this.ends.entries()) label.querySelector("input")!.value = showPlain(range[k], range);
    this.back.hidden = this.earlier.length === 0;
    if (isPart) this.refine();
    else this.begin();
  }

  private zoomOut(): void {
    const before = this.earlier.pop();
    if (before) this.setWindow(before);
  }

  private data(): CloudData {
    const { points } = this;
    const { model, state } = this.context;
    const range = state.range ?? [0, 1];
    const low = Math.min(...range);
    const high = Math.max(...range);
    const here = state.parameter === null ? null : state.params[state.parameter];
    return {
      points,
      box: { x: [low, high], y: this.up ?? (points.length ? spanOfPoints(points.y) : padded(-1, 1, 0)) },
      labels: [state.parameter ?? "", model.states[state.coordinate]],
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
    const { state } = this.context;
    this.earlier.push({ range: state.range!, up: this.up });
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
    this.context.setParameter(state.parameter, Number(showPlain(value, state.range)));
  }

  /** All that the diagram depends on and that is not among its own fields. */
  private motionKey(): string {
    const { params, y0, rtol, atol, method, parameter } = this.context.state;
    const others = Object.fromEntries(Object.entries(params).filter(([name]) => name !== parameter));
    return JSON.stringify([others, y0, rtol, atol, method]);
  }

  private sentence(): string {
    const { model, state } = this.context;
    const [low, high] = state.range ?? [0, 1];
    return (
      `Diagram of ${model.states[state.coordinate]} ${showSection(state.section)} over ${state.parameter} ` +
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
