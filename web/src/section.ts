/** The Poincare section: where the motion is at its returns. */

import { padded } from "./axes.ts";
import { drawCloud, spanOfPoints, type CloudData } from "./cloud.ts";
import { labelled } from "./controls.ts";
import { Points } from "./counts.ts";
import { make, select } from "./dom.ts";
import { pointsCsv } from "./export.ts";
import { Latest } from "./latest.ts";
import { longSpan, motionRequest, sectionRequest } from "./model.ts";
import { count, showName } from "./numbers.ts";
import { wordsOf, type Context, type NumbersFile, type Panel, type Saveable } from "./panel.ts";
import { Picture } from "./picture.ts";
import { toReturns, type Returns } from "./replies.ts";
import { fieldsForm, returnsFields, sectionFields, showSection } from "./sections.ts";

const RETURN = -1; // the number of the return in place of a state

export class SectionPanel implements Panel {
  readonly element: HTMLElement;
  private readonly picture: Picture;
  private readonly form = fieldsForm();
  private readonly words = make("p", { class: "quiet", role: "status" });
  private readonly latest = new Latest<null>(() => this.compute());
  private readonly points = new Points();
  private found: Returns | null = null;
  private axes: [number, number];
  private isShown = false;

  constructor(private readonly context: Context) {
    const { model, state } = context;
    this.axes = model.n > 1 ? [...(state.axes ?? [0, 1])] : [RETURN, 0];
    this.picture = new Picture(
      "section",
      (pen, w, h, theme) => void drawCloud(pen, w, h, this.data(), theme),
      () => context.theme(),
      () => this.sentence(),
    );
    this.element = make("div", { class: "panel" }, this.form, this.words, this.picture.element);
  }

  show(): void {
    this.isShown = true;
    this.form.replaceChildren(...this.fields());
    this.update();
  }

  hide(): void {
    this.isShown = false;
  }

  update(): void {
    if (this.isShown) this.latest.ask(null);
  }

  redraw(): void {
    this.picture.redraw();
  }

  settled(): Promise<void> {
    return this.latest.settled();
  }

  close(): void {
    this.picture.close();
  }

  saveables(): Saveable[] {
    if (!this.found) return [];
    const { width, height } = this.picture;
    return [
      { name: "section", width, height, draw: (pen, w, h, theme) => void drawCloud(pen, w, h, this.data(), theme) },
    ];
  }

  numbers(): NumbersFile[] {
    const { found } = this;
    if (!found) return [];
    const column = (i: number) => Float64Array.from({ length: found.t.length }, (_, k) => found.y[k * found.n + i]);
    const { states } = this.context.model;
    return [
      { name: "section", text: () => pointsCsv(["t", ...states], [found.t, ...states.map((_, i) => column(i))]) },
    ];
  }

  private fields(): HTMLElement[] {
    const { model, state } = this.context;
    const update = () => this.update();
    const names = model.states.map((name, i) => [String(i), showName(name)] as const);
    const axis = (k: 0 | 1) => {
      const own = k === 0 ? [...names, [String(RETURN), "return"] as const] : names;
      return select(k === 0 ? "state across" : "state upwards", own, String(this.axes[k]), (value) => {
        this.axes[k] = Number(value);
        this.place();
      });
    };
    return [
      sectionFields(model, state, update),
      ...returnsFields(state, update),
      labelled("across", axis(0)),
      labelled("up", axis(1)),
    ];
  }

  private async compute(): Promise<void> {
    const { state, engines } = this.context;
    if (state.section === null) {
      this.picture.say("This model has no surface to look at. Choose a period.");
      return;
    }
    try {
      const request = {
        kind: "section",
        ...motionRequest(state),
        t_span: longSpan(state),
        section: sectionRequest(state.section, state.params),
        skip: state.skip,
        count: state.count,
      };
      this.found = toReturns(await engines.many()[0].ask(request));
      this.picture.say(this.found.t.length === 0 ? noReturns(this.found) : null);
      this.words.textContent = "";
      this.place();
    } catch (error) {
      this.found = null;
      this.picture.say(wordsOf(error) ?? "Stopped.");
    }
  }

  /** Put the returns on the chosen axes. */
  private place(): void {
    const { found, points } = this;
    points.clear();
    if (found) {
      const column = (which: number) =>
        Float64Array.from({ length: found.t.length }, (_, k) =>
          which === RETURN ? k + 1 : found.y[k * found.n + which],
        );
      points.add(column(this.axes[0]), column(this.axes[1]));
      const { state } = this.context;
      this.words.textContent = `${count(found.t.length, "return")} ${showSection(state.section)}, after a transient of ${state.skip}`;
    }
    this.picture.redraw();
  }

  private data(): CloudData {
    const { points } = this;
    const box = points.length
      ? { x: spanOfPoints(points.x), y: spanOfPoints(points.y) }
      : { x: padded(0, 1, 0), y: padded(0, 1, 0) };
    const label = (which: number) => (which === RETURN ? "return" : this.context.model.states[which]);
    return {
      points,
      box,
      labels: [label(this.axes[0]), label(this.axes[1])],
      resolution: this.picture.resolution,
      choice: null,
      line: null,
    };
  }

  private sentence(): string {
    const { labels } = this.data();
    return `Poincaré section, ${showSection(this.context.state.section)}: ${count(this.points.length, "point")} over ${labels.join(" and ")}.`;
  }
}

function noReturns({ success, message }: Returns): string {
  const words = "The motion has no returns to this section after the transient.";
  return success ? words : `${words} ${message}`;
}
