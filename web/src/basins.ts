/** The basins of attraction over the window of the portrait: coarse at once, then finer. */

import type { Frame } from "./axes.ts";
import { describeBasins, drawBasins, endName, type BasinsData } from "./cells.ts";
import { numberField } from "./controls.ts";
import { button, make } from "./dom.ts";
import { pointsCsv } from "./export.ts";
import { motionRequest } from "./model.ts";
import { count, showExpression } from "./numbers.ts";
import { WorkPanel, wordsOf, type Context, type NumbersFile, type Saveable } from "./panel.ts";
import { Picture } from "./picture.ts";
import { askAll } from "./pool.ts";
import type { Box } from "./portrait.ts";
import { toBasins, type Basins } from "./replies.ts";

const FIRST = 16;
/** Rows are handed out in so many parts for each worker, so that none waits long for the others. */
const PARTS_OF_A_WORKER = 4;

export class BasinsPanel extends WorkPanel {
  readonly element: HTMLElement;
  protected readonly picture: Picture;
  private readonly words = make("p", { class: "quiet", role: "status" });
  private readonly go = button("Draw", () => (this.job.isRunning ? this.job.stop() : this.begin()));
  private basins: Basins | null = null;
  private box: Box;
  private cells = 128;
  private frame: Frame | null = null;
  /** What the letters of the key mean. */
  private readonly ends = make("ul", { class: "ends" });
  private drawnFor = "";

  constructor(private readonly context: Context) {
    super();
    this.box = context.window();
    this.picture = new Picture(
      "basins",
      (pen, w, h, theme) => void (this.frame = drawBasins(pen, w, h, this.data(), theme)),
      () => context.theme(),
      () => describeBasins(this.data()),
    );
    this.element = make(
      "div",
      { class: "panel" },
      make(
        "form",
        { class: "fields", onsubmit: (event: Event) => event.preventDefault() },
        numberField(
          "cells each way",
          this.cells,
          (value) => ((this.cells = Math.round(value)), this.begin()),
          (value) => value >= 4 && value <= 1024,
        ),
      ),
      make("div", { class: "row" }, this.go, this.words),
      this.picture.element,
      this.ends,
    );
    this.picture.canvas.addEventListener("click", (event) => {
      const { frame } = this;
      const { axes, y0 } = this.context.state;
      if (!frame || !axes) return;
      const { x, y } = this.picture.place(event);
      const start = [...y0];
      [start[axes[0]], start[axes[1]]] = [frame.x.back(x), frame.y.back(y)];
      this.context.start(start);
    });
  }

  show(): void {
    if (this.basins === null && !this.job.isRunning) this.begin();
  }

  update(): void {
    if (this.drawnFor !== "" && this.drawnFor !== this.motionKey() && !this.job.isRunning) {
      this.words.textContent = "Parameters have changed since these basins were drawn.";
    }
    this.picture.redraw();
  }

  saveables(): Saveable[] {
    if (!this.basins) return [];
    const { width, height } = this.picture;
    return [
      { name: "basins", width, height, draw: (pen, w, h, theme) => void drawBasins(pen, w, h, this.data(), theme) },
    ];
  }

  numbers(): NumbersFile[] {
    const { basins, box } = this;
    if (!basins) return [];
    const cell = ([low, high]: readonly [number, number], k: number, n: number) => low + ((k + 0.5) * (high - low)) / n;
    const all = Array.from({ length: basins.label.length }, (_, k) => k);
    const { labels } = this.data();
    return [
      {
        name: "basins",
        text: () =>
          pointsCsv(
            [...labels, "basin"],
            [
              all.map((k) => cell(box.x, k % basins.columns, basins.columns)),
              all.map((k) => cell(box.y, Math.floor(k / basins.columns), basins.rows)),
              basins.label,
            ],
          ),
      },
    ];
  }

  private begin(): void {
    void this.job.start((signal) => this.compute(signal));
  }

  private async compute(signal: AbortSignal): Promise<void> {
    const { state } = this.context;
    if (state.axes === null) {
      this.picture.say("Basins need a plane: this model has one state.");
      return;
    }
    this.box = this.context.window();
    this.basins = null;
    this.drawnFor = this.motionKey();
    this.go.textContent = "Stop";
    this.words.textContent = "The first cells are being computed.";
    this.picture.say(null);
    try {
      for (let cells = FIRST; ; cells *= 2) {
        const size = Math.min(cells, this.cells);
        const { x, y } = this.box;
        const window = { ...motionRequest(state), axes: state.axes, box: [...x, ...y], cells: size };
        const found = await this.shared(window, size, signal);
        signal.throwIfAborted();
        this.basins = found;
        this.ends.replaceChildren(
          ...found.labels.map((label, k) => make("li", {}, make("b", {}, endName(k)), showExpression(label))),
        );
        this.words.textContent = `${size} by ${size} cells · ${count(this.basins.labels.length, "end")} · click to start there`;
        this.picture.redraw();
        if (size === this.cells) break;
      }
    } catch (error) {
      const words = wordsOf(error);
      if (this.basins === null) this.picture.say(words ?? "Stopped before the first cells were there.");
      else this.words.textContent = words ?? `${this.words.textContent} · stopped`;
    } finally {
      this.go.textContent = "Draw again";
      this.picture.redraw();
    }
  }

  /** The ends of the rows come from all workers; one of them groups them. */
  private async shared(window: Record<string, unknown>, size: number, signal: AbortSignal): Promise<Basins> {
    const engines = this.context.engines.many();
    if (engines.length === 1) return toBasins(await engines[0].ask({ kind: "basins", ...window }, signal));
    const height = Math.ceil(size / (PARTS_OF_A_WORKER * engines.length));
    const rows = Array.from({ length: Math.ceil(size / height) }, (_, k) => [k * height, Math.min((k + 1) * height, size)]);
    let ends: Float64Array | null = null;
    await askAll(
      engines,
      rows.map((part) => ({ kind: "ends", ...window, rows: part })),
      (reply, request) => {
        const { data, shape } = reply.table("end");
        ends ??= new Float64Array(size * size * shape[1]);
        ends.set(data, (request.rows as number[])[0] * size * shape[1]);
      },
      signal,
    );
    // what is no number becomes null on its way
    return toBasins(await engines[0].ask({ kind: "basins", ...window, ends: [...(ends ?? [])] }, signal));
  }

  private data(): BasinsData {
    const { model, state } = this.context;
    const [i, j] = state.axes ?? [0, 0];
    return {
      basins: this.basins,
      box: this.box,
      labels: [model.states[i], model.states[j]],
      start: [state.y0[i], state.y0[j]],
    };
  }

  private motionKey(): string {
    const { params, t_span, rtol, atol, method, axes } = this.context.state;
    return JSON.stringify([params, t_span, rtol, atol, method, axes]);
  }
}
