/** Limit cycles and their branches: computed by the kernel, shown only where there is one. */

import { describeBranch, drawBranch, type BranchData } from "./branch.ts";
import { labelled } from "./controls.ts";
import { button, make, select } from "./dom.ts";
import { pointsCsv } from "./export.ts";
import { motionRequest, rangeOf } from "./model.ts";
import { showName, showNumber } from "./numbers.ts";
import { WorkPanel, wordsOf, type Context, type NumbersFile, type Saveable } from "./panel.ts";
import { Picture } from "./picture.ts";
import { engineFor } from "./pool.ts";
import { coordinateField, fieldsForm, parameterField, rangeFields } from "./sections.ts";
import { toBranch, toCycle, type Branch } from "./replies.ts";

export class CyclesPanel extends WorkPanel {
  readonly element: HTMLElement;
  protected readonly picture: Picture;
  private readonly findForm = fieldsForm();
  private readonly followForm = fieldsForm();
  private readonly canFollow: boolean;
  private readonly words = make("p", { class: "quiet", role: "status" });
  private readonly branchWords = make("p", { class: "quiet", role: "status" });
  private readonly special = make("table", { class: "special" });
  private readonly multipliers = make("p", { class: "row quiet" });
  private readonly go = button("Find the cycle that this run leads to", () =>
    this.press(this.go, (signal) => this.find(signal)),
  );
  private readonly follow = button("Follow", () => this.press(this.follow, (signal) => this.continue(signal)));
  private branch: Branch | null = null;
  private of: "cycle" | "equilibrium" = "cycle";
  private foundFor = "";
  /** A point of the cycle that was found: the branch starts there. */
  private start: { readonly t0: number; readonly y0: number[] } | null = null;

  constructor(private readonly context: Context) {
    super();
    const { model } = context;
    this.picture = new Picture(
      "branch",
      (pen, w, h, theme) => void drawBranch(pen, w, h, this.data(), theme),
      () => context.theme(),
      () => describeBranch(this.data()),
    );
    this.canFollow = engineFor(context.engines, "continuation") !== null && model.params.length > 0;
    this.element = make(
      "div",
      { class: "panel" },
      this.findForm,
      make("div", { class: "row" }, this.words),
      this.multipliers,
      this.canFollow ? this.followForm : null,
      this.branchWords,
      this.canFollow ? this.special : null,
      this.canFollow ? this.picture.element : null,
    );
    this.picture.say("A branch is drawn here: cycles by the least and the greatest value of a state.");
  }

  show(): void {
    const { model, state } = this.context;
    this.findForm.replaceChildren(this.go);
    if (!this.canFollow) return;
    const followed = [
      ["cycle", "the cycle"],
      ["equilibrium", "the equilibrium nearby"],
    ] as const;
    this.followForm.replaceChildren(
      labelled(
        "follow",
        select("what is followed", followed, this.of, (value) => (this.of = value as typeof this.of)),
      ),
      parameterField(model, state, (name) => {
        state.range = rangeOf(model, name, state.params[name]);
        this.show();
      }),
      ...rangeFields(state.range ?? [0, 1], (range) => (state.range = range)),
      coordinateField("drawn by", model, state, () => this.picture.redraw()),
      this.follow,
    );
  }

  update(): void {
    if (this.foundFor !== "" && this.foundFor !== this.motionKey()) {
      this.foundFor = "";
      this.start = null;
      this.context.showCycle(null);
      this.words.textContent = "The parameters have changed since the cycle was found.";
      this.multipliers.textContent = "";
    }
    this.picture.redraw();
  }

  saveables(): Saveable[] {
    if (!this.branch) return [];
    const { width, height } = this.picture;
    return [
      { name: "branch", width, height, draw: (pen, w, h, theme) => void drawBranch(pen, w, h, this.data(), theme) },
    ];
  }

  numbers(): NumbersFile[] {
    const { branch } = this;
    if (!branch) return [];
    const { states } = this.context.model;
    const column = (i: number) =>
      Float64Array.from({ length: branch.value.length }, (_, k) => branch.y[k * branch.n + i]);
    return [
      {
        name: "branch",
        text: () =>
          pointsCsv(
            [branch.parameter, ...states, "stable"],
            [branch.value, ...states.map((_, i) => column(i)), branch.stable],
          ),
      },
    ];
  }

  /** Start the work of a button, or stop what runs. */
  private press(by: HTMLButtonElement, work: (signal: AbortSignal) => Promise<void>): void {
    if (this.job.isRunning) {
      this.job.stop();
      return;
    }
    const words = by.textContent;
    by.textContent = "Stop";
    void this.job.start(work).finally(() => (by.textContent = words));
  }

  private async find(signal: AbortSignal): Promise<void> {
    const { state, engines } = this.context;
    const engine = engineFor(engines, "cycle");
    if (engine === null) return;
    this.words.textContent = "The kernel is looking for it.";
    try {
      const request = { kind: "cycle", ...motionRequest(state), ...this.context.end() };
      const cycle = toCycle(await engine.ask(request, signal));
      this.start = { t0: cycle.run.t[0], y0: [...cycle.run.y.subarray(0, cycle.run.n)] };
      this.foundFor = this.motionKey();
      this.context.showCycle(cycle.run);
      this.words.textContent =
        cycle.text || `A ${cycle.stable ? "stable" : "unstable"} cycle of period ${showNumber(cycle.period)}.`;
      this.multipliers.textContent = cycle.multipliers.length
        ? `Multipliers: ${cycle.multipliers.map(showComplex).join(",  ")}`
        : "";
    } catch (error) {
      this.words.textContent = wordsOf(error) ?? "Stopped.";
    }
  }

  private async continue(signal: AbortSignal): Promise<void> {
    const { state, engines } = this.context;
    const engine = engineFor(engines, "continuation");
    if (engine === null) return;
    this.branchWords.textContent = "The kernel is following it.";
    try {
      const { parameter, range } = state;
      const start = this.start ?? this.context.end();
      const request = { kind: "continuation", ...motionRequest(state), ...start, parameter, range, of: this.of };
      this.branch = toBranch(await engine.ask(request, signal));
      this.branchWords.textContent = this.branch.text;
      this.special.replaceChildren(...this.specialRows(this.branch));
      this.picture.say(this.branch.value.length === 0 ? "The branch has no points." : null);
    } catch (error) {
      this.branch = null;
      this.branchWords.textContent = "";
      this.special.replaceChildren();
      this.picture.say(wordsOf(error) ?? "Stopped.");
    }
    this.picture.redraw();
  }

  /** A row for each special point; a press takes its value of the parameter over into the pictures above. */
  private specialRows({ parameter, special }: Branch): HTMLElement[] {
    return special.map(({ code, value, text }) => {
      const adopt = () => this.context.setParameter(parameter, value);
      const at = button(`${showName(parameter)} = ${showNumber(value, 8)}`, adopt, "set the parameter to this value");
      const cells = [make("td", {}, at), make("td", {}, text.replaceAll(" - ", " − "))];
      return make("tr", {}, make("th", { scope: "row" }, code), ...cells);
    });
  }

  private data(): BranchData {
    const { model, state } = this.context;
    const parameter = this.branch?.parameter ?? state.parameter ?? "";
    return {
      branch: this.branch,
      state: state.coordinate,
      labels: [parameter, model.states[state.coordinate]],
      here: state.params[parameter],
    };
  }

  private motionKey(): string {
    const { params, rtol, atol, method } = this.context.state;
    return JSON.stringify([params, rtol, atol, method]);
  }
}

function showComplex([re, im]: readonly [number, number]): string {
  if (Math.abs(im) < 1e-12 * Math.max(1, Math.abs(re))) return showNumber(re, 5);
  return `${showNumber(re, 5)} ${im < 0 ? "−" : "+"} ${showNumber(Math.abs(im), 5)}i`;
}
