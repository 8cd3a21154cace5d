/** The motion on the screen: one run, its phase portrait and its time series, and what a pointer does to them. */

import type { Frame, Interval } from "./axes.ts";
import { boundsOf, modesOf, stateAt } from "./curves.ts";
import type { Engine } from "./engine.ts";
import { Latest } from "./latest.ts";
import { motionRequest, type Description, type State } from "./model.ts";
import { ModeNumbers, showMode } from "./modes.ts";
import { showName, showNumber } from "./numbers.ts";
import { wordsOf, type Saveable } from "./panel.ts";
import { Picture } from "./picture.ts";
import { boxOf, describePortrait, drawPortrait, fits, type Box, type PortraitData } from "./portrait.ts";
import { toPlane, toRun, type Plane, type Run } from "./replies.ts";
import { describeSeries, drawSeries, spansOf, type SeriesData } from "./series.ts";
import { MOST_KEPT } from "./share.ts";
import type { Theme } from "./theme.ts";

export interface MotionHooks {
  theme(): Theme;
  /** A run has come, or it failed with words; both are `null` if it was stopped. */
  ran(run: Run | null, words: string | null): void;
  /** The plane of the portrait has come, or it failed; what is to be said of it. */
  planed(words: string | null): void;
  /** A pointer or a key has chosen another start. */
  started(): void;
  /** Other states stand on the axes of the portrait. */
  axesChosen(axes: readonly [number, number]): void;
  /** What stands at the pointer, in words; empty for nothing. */
  read(words: string): void;
  /** A computation takes long, or it has ended. */
  busy(isBusy: boolean): void;
}

/** What is fitted to the run when it has come. While something is dragged the axes hold. */
type Fitted = "nothing" | "series" | "all";

const MOST_PANELS = 4;
const LONG = 250; // milliseconds
const CELLS = 72;
const [FEWEST_ARROWS, MOST_ARROWS, PIXELS_PER_ARROW] = [8, 24, 22];
const KEY_STEP = 0.01; // of the window

export class Motion {
  readonly portrait: Picture | null;
  readonly series: Picture;
  run: Run | null = null;
  private kept: Run[] = [];
  private cycle: Run | null = null;
  private plane: Plane | null = null;
  private box: Box | null = null;
  private spans: Interval[] = [];
  private zoomed: Interval | null = null;
  private cursor: number | null = null;
  private frame: Frame | null = null;
  private time: Frame["x"] | null = null;
  private shown: number[];
  private stopper = new AbortController();
  private readonly modes = new ModeNumbers();
  private readonly latest = new Latest<Fitted>((fitted) => this.compute(fitted));
  private readonly latestPlane = new Latest<null>(() => this.computePlane());

  constructor(
    private readonly model: Description,
    private readonly state: State,
    private readonly engine: Engine,
    private readonly hooks: MotionHooks,
  ) {
    this.shown = Array.from({ length: Math.min(model.n, MOST_PANELS) }, (_, k) => k);
    const theme = () => hooks.theme();
    this.portrait =
      state.axes === null
        ? null
        : new Picture(
            "portrait",
            (pen, w, h, t) => void (this.frame = this.paintPortrait(pen, w, h, t, false)),
            theme,
            () => describePortrait(this.portraitData(false)),
          );
    this.series = new Picture(
      "series",
      (pen, w, h, t) => void (this.time = drawSeries(pen, w, h, this.seriesData(), t)),
      theme,
      () => describeSeries(this.seriesData()),
    );
    if (state.box) this.box = { x: [state.box[0], state.box[1]], y: [state.box[2], state.box[3]] };
    if (this.portrait) this.listenPortrait(this.portrait);
    this.listenSeries();
  }

  /** Compute again; while something is dragged the axes hold. */
  update(isDragging: boolean): void {
    this.latest.ask(isDragging ? "nothing" : "all");
  }

  /** Compute from a start that was chosen in the window of the portrait: the window stays. */
  startInWindow(isDragging = false): void {
    this.latest.ask(isDragging ? "nothing" : "series");
  }

  async settled(): Promise<void> {
    await this.latest.settled();
    await this.latestPlane.settled();
  }

  stop(): void {
    this.stopper.abort(new DOMException("stopped", "AbortError"));
    this.stopper = new AbortController();
  }

  /** Fit all axes to the motion. */
  fit(): void {
    this.state.box = null;
    this.zoomed = null;
    this.box = null;
    if (this.run) this.fitTo(this.run);
    this.latestPlane.ask(null);
    this.redraw();
  }

  /** Show other states in the portrait. */
  setAxes(axes: [number, number]): void {
    this.state.axes = axes;
    this.plane = null;
    this.fit();
  }

  /** The states that have a panel in the time series. */
  setShown(shown: number[]): void {
    this.shown = shown.length ? shown : [0];
    this.series.redraw();
  }

  get panels(): readonly number[] {
    return this.shown;
  }

  /** Draw a cycle over everything else, or take it away. */
  showCycle(run: Run | null): void {
    this.cycle = run;
    this.portrait?.redraw();
  }

  keep(): void {
    this.state.kept = [...this.state.kept, [...this.state.y0]].slice(-MOST_KEPT);
    this.startInWindow();
  }

  clear(): void {
    this.state.kept = [];
    this.kept = [];
    this.portrait?.redraw();
  }

  /** Mark an instant in both pictures; a field that depends on the time is that of the instant. */
  mark(t: number | null): void {
    this.cursor = t;
    if (this.plane !== null && this.plane.instant !== null) this.latestPlane.ask(null);
    const at = t !== null && this.run ? stateAt(this.run, t) : null;
    if (at === null) this.hooks.read("");
    else {
      const values = at.y
        .map((value, i) => `${showName(this.model.states[i])} = ${showNumber(value, 5)}`)
        .slice(0, MOST_PANELS);
      this.hooks.read([`t = ${showNumber(t!, 5)}`, ...values, `mode ${showMode(at.mode)}`].join("    "));
    }
    this.redraw();
  }

  window(): Box {
    return this.box ?? { x: [-1, 1], y: [-1, 1] };
  }

  redraw(): void {
    this.portrait?.redraw();
    this.series.redraw();
  }

  /** The pictures as they are saved: with the modes in the key of the portrait. */
  saveables(): Saveable[] {
    const series: Saveable = {
      name: "time series",
      width: this.series.width,
      height: this.series.height,
      draw: (pen, w, h, theme) => void drawSeries(pen, w, h, { ...this.seriesData(), cursor: null }, theme),
    };
    if (!this.portrait) return [series];
    const { width, height } = this.portrait;
    return [
      {
        name: "phase portrait",
        width,
        height,
        draw: (pen, w, h, theme) => void this.paintPortrait(pen, w, h, theme, true),
      },
      series,
    ];
  }

  close(): void {
    this.portrait?.close();
    this.series.close();
  }

  private async compute(fitted: Fitted): Promise<void> {
    const { signal } = this.stopper;
    const slow = setTimeout(() => this.hooks.busy(true), LONG);
    try {
      const run = toRun(await this.engine.ask({ kind: "run", ...motionRequest(this.state) }, signal));
      const kept: Run[] = [];
      for (const y0 of this.state.kept)
        kept.push(toRun(await this.engine.ask({ kind: "run", ...motionRequest(this.state), y0 }, signal)));
      this.run = run;
      this.modes.note(modesOf(run));
      this.kept = kept;
      if (run.t.length === 0) throw new Error(run.message || "The run has no points.");
      if (this.cursor !== null && stateAt(run, this.cursor) === null) this.cursor = null;
      this.fitIfNeeded(run, fitted);
      this.say(null);
      this.hooks.ran(run, null);
    } catch (error) {
      const words = wordsOf(error);
      if (words !== null || this.run === null) {
        this.run = null;
        this.say(words ?? "The computation was stopped. Move a slider to start another one.");
      }
      this.hooks.ran(null, words);
    } finally {
      clearTimeout(slow);
      this.hooks.busy(false);
      this.redraw();
    }
    this.latestPlane.ask(null);
  }

  private async computePlane(): Promise<void> {
    const { axes, params, y0, t_span } = this.state;
    if (axes === null || this.box === null) return;
    const { x, y } = this.box;
    const size = Math.min(this.portrait?.width ?? 0, this.portrait?.height ?? 0);
    const arrows = Math.min(MOST_ARROWS, Math.max(FEWEST_ARROWS, Math.round(size / PIXELS_PER_ARROW)));
    try {
      const box = [...x, ...y];
      const t = this.cursor ?? t_span[0];
      const request = { kind: "portrait", t, params, axes, box, rest: y0, cells: CELLS, arrows };
      this.plane = toPlane(await this.engine.ask(request, this.stopper.signal), t);
      const { equilibria, searched } = this.plane;
      this.hooks.planed(equilibria.some((point) => point.admissible) ? searched : null);
    } catch (error) {
      this.plane = null; // the trajectory stands without the plane
      const words = wordsOf(error);
      this.hooks.planed(words === null ? null : `The surfaces are missing: ${words}`);
    }
    this.portrait?.redraw();
  }

  /** A plane on which nothing moves shows nothing: the first two states that move take its place. */
  private chooseAxes(run: Run): void {
    const { axes } = this.state;
    if (axes === null || this.model.page.axes !== null || this.box !== null) return;
    const moving = boundsOf(run).flatMap(([low, high], i) => (high > low ? [i] : []));
    if (moving.length < 2 || axes.some((i) => moving.includes(i))) return;
    this.state.axes = [moving[0], moving[1]];
    this.hooks.axesChosen(this.state.axes);
  }

  private fitIfNeeded(run: Run, fitted: Fitted): void {
    this.chooseAxes(run);
    const { axes, box } = this.state;
    if (this.spans.length === 0) this.spans = spansOf(run);
    if (axes !== null && this.box === null) this.box = boxOf(run, axes);
    if (fitted === "nothing") return;
    this.spans = spansOf(run);
    if (fitted === "series" || box !== null) return;
    if (axes !== null && this.box !== null && !fits(run, axes, this.box)) this.box = boxOf(run, axes);
  }

  private fitTo(run: Run): void {
    if (this.state.axes !== null) this.box = boxOf(run, this.state.axes);
    this.spans = spansOf(run);
  }

  private say(words: string | null): void {
    this.portrait?.say(words);
    this.series.say(words);
  }

  private paintPortrait(...[pen, width, height, theme, withModes]: [...Parameters<Saveable["draw"]>, boolean]): Frame {
    return drawPortrait(pen, width, height, this.portraitData(withModes), theme);
  }

  private portraitData(withModes: boolean): PortraitData {
    const { model, run, kept, plane } = this;
    const at = this.cursor !== null && run ? stateAt(run, this.cursor) : null;
    return {
      run,
      kept,
      cycle: this.cycle,
      plane,
      axes: this.state.axes ?? [0, 0],
      box: this.window(),
      states: model.states,
      surfaces: model.surfaces,
      modes: this.modes,
      start: this.state.y0,
      marked: at?.y ?? null,
      withModes,
    };
  }

  private seriesData(): SeriesData {
    const { run, model } = this;
    const [from, to] = this.state.t_span;
    const at = this.cursor !== null && run ? stateAt(run, this.cursor) : null;
    return {
      run,
      states: model.states,
      surfaces: model.surfaces,
      modes: this.modes,
      shown: this.shown,
      window: this.zoomed ?? [from, to],
      spans: this.spans,
      cursor: at ? { t: this.cursor!, y: at.y } : null,
    };
  }

  private startAt(values: readonly [number, number], isDragging = false): void {
    const [i, j] = this.state.axes!;
    const digits = (value: number, [low, high]: Interval) => {
      const step = 10 ** Math.floor(Math.log10((high - low) / 1000));
      return Number((Math.round(value / step) * step).toPrecision(12));
    };
    const { x, y } = this.window();
    this.state.y0[i] = digits(values[0], x);
    this.state.y0[j] = digits(values[1], y);
    this.hooks.started();
    this.startInWindow(isDragging);
  }

  private listenPortrait(picture: Picture): void {
    const { canvas } = picture;
    canvas.tabIndex = 0;
    let isPressed = false;
    const start = (event: PointerEvent) => {
      const { frame } = this;
      if (!frame) return;
      const { x, y } = picture.place(event);
      const within = (place: number, [a, b]: Interval) => place >= Math.min(a, b) && place <= Math.max(a, b);
      if (!within(x, frame.x.places) || !within(y, frame.y.places)) return;
      this.startAt([frame.x.back(x), frame.y.back(y)], isPressed);
    };
    canvas.addEventListener("pointerdown", (event) => {
      if (event.button !== 0 || event.pointerType === "touch") return;
      isPressed = true;
      canvas.setPointerCapture(event.pointerId);
      start(event);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (isPressed) start(event);
    });
    const release = () => {
      if (isPressed) this.startInWindow();
      isPressed = false;
    };
    canvas.addEventListener("pointerup", release);
    canvas.addEventListener("pointercancel", release);
    // a finger that moves scrolls the page; one that taps starts a trajectory
    canvas.addEventListener("click", (event) => {
      if ((event as PointerEvent).pointerType === "touch") start(event as PointerEvent);
    });
    canvas.addEventListener("keydown", (event) => this.key(event));
    canvas.addEventListener(
      "wheel",
      (event) => {
        if (!event.ctrlKey && !event.metaKey) return; // the page scrolls
        event.preventDefault();
        const { frame } = this;
        if (!frame) return;
        const { x, y } = picture.place(event);
        this.zoom(Math.exp(0.002 * event.deltaY), [frame.x.back(x), frame.y.back(y)]);
      },
      { passive: false },
    );
  }

  private key(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const { axes, y0 } = this.state;
    const { x, y } = this.window();
    const direction = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (direction && axes) {
      const size = KEY_STEP * (event.shiftKey ? 10 : 1);
      this.startAt([
        y0[axes[0]] + direction[0] * size * (x[1] - x[0]),
        y0[axes[1]] + direction[1] * size * (y[1] - y[0]),
      ]);
    } else if (event.key === "f") this.fit();
    else if (event.key === "k") this.keep();
    else if (event.key === "+" || event.key === "=") this.zoom(1 / 1.25);
    else if (event.key === "-") this.zoom(1.25);
    else return;
    event.preventDefault();
  }

  /** Zoom about a point, or about the middle. */
  zoom(factor: number, about?: readonly [number, number]): void {
    const { x, y } = this.window();
    const around = ([low, high]: Interval, middle: number): [number, number] => [
      middle + factor * (low - middle),
      middle + factor * (high - middle),
    ];
    const [cx, cy] = about ?? [0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1])];
    this.box = { x: around(x, cx), y: around(y, cy) };
    this.state.box = [...this.box.x, ...this.box.y] as [number, number, number, number];
    this.latestPlane.ask(null);
    this.redraw();
  }

  private listenSeries(): void {
    const { canvas } = this.series;
    canvas.tabIndex = 0;
    let from: number | null = null;
    const timeAt = (event: PointerEvent): number | null => {
      if (!this.time) return null;
      const { x } = this.series.place(event);
      const [left, right] = this.time.places;
      return x < left || x > right ? null : this.time.back(x);
    };
    canvas.addEventListener("pointermove", (event) => this.mark(timeAt(event)));
    canvas.addEventListener("pointerleave", () => this.mark(null));
    canvas.addEventListener("pointerdown", (event) => {
      if (event.pointerType !== "touch") from = timeAt(event);
    });
    canvas.addEventListener("pointerup", (event) => {
      const to = timeAt(event);
      if (from !== null && to !== null && this.time) {
        const [low, high] = [Math.min(from, to), Math.max(from, to)];
        const [left, right] = this.time.values;
        if (high - low > 0.02 * Math.abs(right - left)) this.zoomed = left < right ? [low, high] : [high, low];
      }
      from = null;
      this.series.redraw();
    });
    canvas.addEventListener("dblclick", () => {
      this.zoomed = null;
      this.series.redraw();
    });
    canvas.addEventListener("keydown", (event) => this.seriesKey(event));
  }

  /** Arrow keys move the mark along the time, by a hundredth of what is shown; Escape takes it away. */
  private seriesKey(event: KeyboardEvent): void {
    const [from, to] = this.zoomed ?? this.state.t_span;
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (step !== undefined) {
      const next = (this.cursor ?? from) + step * (event.shiftKey ? 0.1 : 0.01) * (to - from);
      this.mark(Math.min(Math.max(next, Math.min(from, to)), Math.max(from, to)));
    } else if (event.key === "Escape") {
      this.zoomed = null;
      this.mark(null);
    } else return;
    event.preventDefault();
  }
}
