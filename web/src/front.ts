/** The whole front: header, sliders, the pictures of the motion, and the places below them. */

import { BasinsPanel } from "./basins.ts";
import { labelled, numberField, quantity, type Quantity } from "./controls.ts";
import { CyclesPanel } from "./cycles.ts";
import { DiagramPanel } from "./diagram.ts";
import { button, freshId, make, select } from "./dom.ts";
import { makeEditor, type Editor, type TextReader } from "./editor.ts";
import { showSwitches } from "./events.ts";
import { curveCsv, save, switchesCsv, writePng, writeSvg } from "./export.ts";
import {
  initialState,
  motionRequest,
  PLACES,
  rangeOf,
  startRange,
  type Description,
  type Place,
  type State,
} from "./model.ts";
import { Motion } from "./motion.ts";
import { count, showExpression, showName, showNumber } from "./numbers.ts";
import type { Context, Panel } from "./panel.ts";
import { engineFor, type Engines } from "./pool.ts";
import type { Run } from "./replies.ts";
import { writeScript } from "./script.ts";
import { SectionPanel } from "./section.ts";
import { writeFragment } from "./share.ts";
import { applyTheme, DARK, LIGHT, type Theme } from "./theme.ts";

/** What the host of the front offers. */
export interface Host {
  /** The bytes of the model, or `null` if it lives in a kernel. */
  readonly bytes: Uint8Array | null;
  /** The name under which the page has the model. */
  readonly problem: string | null;
  /** Models that the page offers. */
  readonly problems: readonly { readonly name: string; readonly title: string }[];
  /** The address that a link is added to; `null` if links make no sense here. */
  readonly address: string | null;
  /** Whether the host is dark; by default as the system says. */
  readonly dark?: boolean;
  openProblem?(name: string): void;
  openModel?(model: Uint8Array): void;
  reader(): Promise<TextReader | null>;
  /** The state has changed, and the motion with it. */
  changed?(state: State): void;
}

const PLACE_NAMES: Record<Place, string> = {
  switches: "Switches",
  section: "Poincaré section",
  diagram: "Diagram",
  basins: "Basins",
  cycles: "Cycles",
  model: "Model",
};
const METHODS = ["auto", "DOPRI5", "DOP853", "Taylor", "Midpoint", "Rodas5P"];
const MANY_STATES = 6;

export class Front {
  private readonly motion: Motion;
  private readonly panels = new Map<Place, Panel>();
  private readonly sliders = new Map<string, Quantity>();
  private theme: Theme;
  private readonly scheme = window.matchMedia("(prefers-color-scheme: dark)");
  private hasChosenTheme = false;
  private readonly status = make("p", { class: "status", role: "status" });
  private readonly planeWords = make("p", { class: "quiet", role: "status" });
  private readonly reading = make("p", { class: "reading", "aria-hidden": "true" });
  private readonly hint = make("p", { class: "quiet" }, "Click in the portrait to start elsewhere.");
  private editor: Editor | null = null;
  private axisFields: HTMLSelectElement[] = [];
  private readonly stopButton = button("Stop", () => this.motion.stop());
  private readonly notice = make("p", { class: "notice", role: "status" });
  private readonly tabs = new Map<Place, { tab: HTMLButtonElement; body: HTMLElement }>();
  private readonly switches = make("div", {
    class: "switches",
    tabindex: 0,
    role: "region",
    "aria-label": "table of switches",
  });
  private readonly closers: (() => void)[] = [];

  constructor(
    private readonly root: HTMLElement,
    private readonly engines: Engines,
    private readonly model: Description,
    private readonly state: State,
    private readonly host: Host,
  ) {
    this.theme = (host.dark ?? this.scheme.matches) ? DARK : LIGHT;
    this.motion = new Motion(model, state, engines.quick, {
      theme: () => this.theme,
      ran: (run, words) => this.ran(run, words),
      axesChosen: (axes) => this.axisFields.forEach((field, k) => (field.value = String(axes[k]))),
      planed: (words) => (this.planeWords.textContent = words ?? ""),
      started: () => {
        this.hint.hidden = true;
        this.showValues();
      },
      read: (words) => (this.reading.textContent = words),
      busy: (isBusy) => {
        this.stopButton.hidden = !isBusy;
        this.root.classList.toggle("busy", isBusy);
      },
    });
    this.makePanels();
    this.build();
    this.applyTheme();
    const follow = () => {
      if (this.hasChosenTheme || host.dark !== undefined) return;
      this.theme = this.scheme.matches ? DARK : LIGHT;
      this.applyTheme();
    };
    this.scheme.addEventListener("change", follow);
    this.closers.push(() => this.scheme.removeEventListener("change", follow));
    this.showPlace(this.state.place);
    this.motion.update(false);
  }

  /** Resolves when all that was asked for is on the screen. */
  async settled(): Promise<void> {
    await this.motion.settled();
    for (const panel of this.panels.values()) await panel.settled();
    await new Promise((resolve) => requestAnimationFrame(() => resolve(null)));
  }

  /** A title for the window. */
  get title(): string {
    const name = this.host.problem?.replaceAll("_", " ") ?? this.model.page.title;
    return name ? `${name} · filippov` : "filippov";
  }

  /** What the user has set. */
  get view(): Readonly<State> {
    return this.state;
  }

  /** Start and time, as far as the user has changed them: the next model begins with them. */
  get ownStart(): Partial<Pick<State, "y0" | "t_span">> {
    const isOwn = (name: "y0" | "t_span") => this.state[name].some((value, k) => value !== this.model.page[name][k]);
    return { ...(isOwn("y0") && { y0: this.state.y0 }), ...(isOwn("t_span") && { t_span: this.state.t_span }) };
  }

  /** The run on the screen. */
  get run(): Run | null {
    return this.motion.run;
  }

  /** Take over values that were set elsewhere, as by a program. */
  take(values: Partial<Pick<State, "params" | "y0" | "t_span">>): void {
    if (values.params) Object.assign(this.state.params, values.params);
    if (values.y0) this.state.y0.splice(0, this.model.n, ...values.y0);
    if (values.t_span) this.state.t_span = [values.t_span[0], values.t_span[1]];
    this.showValues();
    this.motion.update(false);
  }

  /** The fragment of a link to what is on the screen. */
  fragment(): Promise<string> {
    const { problem, bytes } = this.host;
    return writeFragment(problem !== null ? { problem } : { model: bytes ?? new Uint8Array() }, this.state);
  }

  close(): void {
    for (const close of this.closers) close();
    for (const panel of this.panels.values()) panel.close();
    this.motion.close();
    this.engines.close();
    this.root.replaceChildren();
  }

  private makePanels(): void {
    const { model, state, engines } = this;
    const context: Context = {
      model,
      state,
      engines,
      theme: () => this.theme,
      window: () => this.motion.window(),
      end: () => {
        const { run } = this.motion;
        return run === null ? null : { t0: run.t[run.t.length - 1], y0: [...run.y.subarray(run.y.length - run.n)] };
      },
      showCycle: (run) => this.motion.showCycle(run),
      start: (y0) => {
        state.y0.splice(0, model.n, ...y0);
        this.showValues();
        this.motion.startInWindow();
      },
      setParameter: (name, value) => {
        state.params[name] = value;
        this.showValues();
        this.motion.update(false);
      },
    };
    const { kinds } = engines.quick;
    if (kinds.has("section")) this.panels.set("section", new SectionPanel(context));
    if (kinds.has("diagram") && model.params.length > 0) this.panels.set("diagram", new DiagramPanel(context));
    if (kinds.has("basins") && model.n > 1) this.panels.set("basins", new BasinsPanel(context));
    if (engineFor(engines, "cycle") !== null) this.panels.set("cycles", new CyclesPanel(context));
  }

  private build(): void {
    const { root, motion } = this;
    root.classList.add("filippov");
    this.stopButton.hidden = true;
    const pictures = make(
      "div",
      { class: motion.portrait ? "pictures" : "pictures single" },
      motion.portrait ? this.buildPortrait() : null,
      this.buildSeries(),
      make("div", { class: "line" }, this.status, this.stopButton, motion.portrait ? this.hint : null),
      this.planeWords,
    );
    root.replaceChildren(
      this.buildHeader(),
      make("div", { class: "body" }, this.buildControls(), pictures, this.buildPlaces()),
    );
  }

  private buildHeader(): HTMLElement {
    const { model, host } = this;
    const plain = (text: string | null) => (text ?? "").replaceAll("_", " ");
    const title = plain(model.page.title) === plain(host.problem) ? "" : model.page.title;
    const known = host.problems.map((problem) => [problem.name, problem.title] as const);
    const isKnown = host.problem !== null && known.some(([name]) => name === host.problem);
    const own = isKnown ? [] : ([["", host.problem ?? (plain(model.page.title) || "a model of your own")]] as const);
    const choice =
      host.openProblem && known.length > 1
        ? select("model", [...own, ...known], isKnown ? host.problem! : "", (chosen) => host.openProblem!(chosen))
        : null;
    const share =
      host.address === null
        ? null
        : button("Copy link", () => void this.share(), "a link that holds the model and this view");
    const theme = button("", () => this.toggleTheme());
    theme.className = "theme";
    return make(
      "header",
      {},
      make("h1", {}, host.address === null ? "filippov" : make("a", { href: "index.html" }, "filippov")),
      choice,
      isKnown || !choice ? make("p", { class: "title" }, title || (choice ? "" : "a model of your own")) : null,
      this.notice,
      make("nav", { "aria-label": "share and save" }, share, this.buildMenu(), theme),
    );
  }

  private buildMenu(): HTMLElement {
    const list = make("div", { class: "list" });
    const menu = make("details", { class: "menu" }, make("summary", {}, "Save"), list);
    const file = (text: string, press: () => void) =>
      button(text, () => {
        menu.open = false;
        press();
      });
    const fill = () => {
      const panels = [...this.panels.values()];
      const pictures = [this.motion, ...panels].flatMap((owner) => owner.saveables());
      list.replaceChildren(
        ...pictures.map((picture) =>
          make(
            "div",
            { class: "file" },
            make("span", {}, picture.name),
            file(
              "PNG",
              () =>
                void writePng(picture.draw, picture.width, picture.height, this.theme).then((blob) =>
                  save(this.fileName(picture.name, "png"), blob),
                ),
            ),
            file("SVG", () =>
              save(
                this.fileName(picture.name, "svg"),
                writeSvg(picture.draw, picture.width, picture.height, this.theme),
                "image/svg+xml",
              ),
            ),
          ),
        ),
      );
      const { run } = this.motion;
      const { states } = this.model;
      const tables = panels.flatMap((panel) => panel.numbers());
      if (run) {
        tables.unshift(
          { name: "curve", text: () => curveCsv(run, states) },
          { name: "switches", text: () => switchesCsv(run, states) },
        );
      }
      for (const table of tables) {
        list.append(
          make(
            "div",
            { class: "file" },
            make("span", {}, table.name),
            file("CSV", () => save(this.fileName(table.name, "csv"), table.text(), "text/csv")),
          ),
        );
      }
      list.append(
        make(
          "div",
          { class: "file" },
          make("span", {}, "Python script"),
          file("py", () => this.saveScript()),
        ),
      );
    };
    menu.addEventListener("toggle", () => menu.open && fill());
    const away = (event: Event) => {
      if (event instanceof KeyboardEvent ? event.key === "Escape" : !event.composedPath().includes(menu))
        menu.open = false;
    };
    document.addEventListener("pointerdown", away);
    menu.addEventListener("keydown", away);
    this.closers.push(() => document.removeEventListener("pointerdown", away));
    return menu;
  }

  private fileName(name: string, kind: string): string {
    return `${this.host.problem ?? "filippov"}_${name.replaceAll(" ", "_")}.${kind}`;
  }

  /** The script: of the page where it holds the model, else of the kernel, which knows where its system comes from. */
  private async script(): Promise<string> {
    const engine = engineFor(this.engines, "script");
    if (engine === null) return writeScript(this.model, this.state, this.host.bytes ?? new Uint8Array());
    return String((await engine.ask({ kind: "script", ...motionRequest(this.state) })).header.text);
  }

  private saveScript(): void {
    const write = (text: string) => save(this.fileName("run", "py"), text, "text/x-python");
    void this.script().then(write, (error: Error) => this.say(error.message));
  }

  private buildControls(): HTMLElement {
    const { model, state, motion } = this;
    const settle = () => motion.update(false);
    const slider = (
      key: string,
      label: string,
      title: string,
      value: number,
      range: readonly [number, number],
      take: (value: number) => void,
    ) => {
      const made = quantity({
        label,
        title,
        value,
        range,
        input: (changed) => {
          take(changed);
          motion.update(true);
        },
        done: settle,
      });
      this.sliders.set(key, made);
      return made.element;
    };
    const group = (title: string, elements: HTMLElement[], isOpen = true) => {
      const details = make(
        "details",
        { class: "group", open: isOpen },
        make("summary", {}, make("h2", {}, title)),
        ...elements,
      );
      return elements.length ? details : null;
    };
    const params = model.params.map(({ name, value }) =>
      slider(
        `p ${name}`,
        name,
        `parameter ${name}`,
        state.params[name],
        rangeOf(model, name, value),
        (v) => (state.params[name] = v),
      ),
    );
    const start = model.states.map((name, i) =>
      slider(`y ${i}`, name, `initial value of ${name}`, state.y0[i], startRange(model, i), (v) => (state.y0[i] = v)),
    );
    const [from, to] = model.page.t_span;
    const time = slider(
      "t",
      "until t",
      "end of the time",
      state.t_span[1],
      to > from ? [from, 2 * to - from] : [2 * to - from, from],
      (v) => {
        if (v !== state.t_span[0]) state.t_span = [state.t_span[0], v];
      },
    );
    const positive = (value: number) => value > 0;
    const numerics = [
      make(
        "div",
        { class: "fields" },
        numberField(
          "from t",
          state.t_span[0],
          (v) => ((state.t_span = [v, state.t_span[1]]), settle()),
          (v) => v !== state.t_span[1],
        ),
        numberField("rtol", state.rtol, (v) => ((state.rtol = v), settle()), positive),
        numberField("atol", state.atol, (v) => ((state.atol = v), settle()), positive),
        labelled(
          "method",
          select(
            "method",
            [...new Set([...METHODS, state.method])].map((m) => [m, m] as const),
            state.method,
            (m) => ((state.method = m), settle()),
          ),
        ),
      ),
    ];
    return make(
      "form",
      {
        class: "controls",
        "aria-label": "parameters, start and time",
        onsubmit: (event: Event) => event.preventDefault(),
      },
      group("Parameters", params),
      group("Start", start.slice(0, MANY_STATES)),
      group(`${model.n - MANY_STATES} more states`, start.slice(MANY_STATES), false),
      group("Time", [time]),
      group("Accuracy", numerics, false),
      make(
        "div",
        { class: "row" },
        button("Reset", () => this.reset(), "parameters, start and time as the model has them"),
      ),
    );
  }

  private buildPortrait(): HTMLElement {
    const { model, motion, state } = this;
    const axis = (k: 0 | 1) =>
      select(
        k === 0 ? "state across" : "state upwards",
        model.states.map((name, i) => [String(i), showName(name)] as const),
        String(state.axes![k]),
        (value) => {
          const axes: [number, number] = [...state.axes!];
          axes[k] = Number(value);
          if (axes[0] === axes[1]) axes[1 - k] = state.axes![k];
          this.axisFields.forEach((field, i) => (field.value = String(axes[i])));
          motion.setAxes(axes);
        },
      );
    this.axisFields = [axis(0), axis(1)];
    const tools = make(
      "div",
      { class: "tools" },
      ...(model.n > 2 ? [this.axisFields[0], make("span", { class: "quiet" }, "and"), this.axisFields[1]] : []),
      button("Keep", () => motion.keep(), "keep this trajectory in the portrait (k)"),
      button("Clear", () => motion.clear(), "take the kept trajectories away"),
      button("−", () => motion.zoom(1.25), "smaller (−)"),
      button("+", () => motion.zoom(1 / 1.25), "larger (+)"),
      button("Fit", () => motion.fit(), "fit the axes to the motion (f)"),
    );
    return make(
      "section",
      { class: "figure", "aria-label": "phase portrait" },
      make("div", { class: "head" }, make("h2", {}, "Phase portrait"), tools),
      motion.portrait!.element,
    );
  }

  private buildSeries(): HTMLElement {
    const { model, motion } = this;
    const tools = make("div", { class: "tools" });
    if (model.n > motion.panels.length) {
      const boxes = model.states.map((name, i) => {
        const box = make("input", { type: "checkbox", checked: motion.panels.includes(i) });
        box.addEventListener("change", () =>
          motion.setShown(boxes.flatMap(({ box: one }, k) => (one.checked ? [k] : []))),
        );
        return { box, element: make("label", { class: "check" }, box, showName(name)) };
      });
      tools.append(
        make(
          "details",
          { class: "menu" },
          make("summary", {}, "States"),
          make("div", { class: "list" }, ...boxes.map(({ element }) => element)),
        ),
      );
    }
    return make(
      "section",
      { class: "figure", "aria-label": "time series" },
      make("div", { class: "head" }, make("h2", {}, "Time series"), this.reading, tools),
      motion.series.element,
    );
  }

  private buildPlaces(): HTMLElement {
    const list = make("div", { role: "tablist", "aria-label": "more views" });
    const section = make("section", { class: "places" }, list);
    const bodies: Partial<Record<Place, HTMLElement>> = { switches: this.switches, model: this.buildModel() };
    for (const [place, panel] of this.panels) bodies[place] = panel.element;
    const order = PLACES.filter((place) => bodies[place]);
    for (const place of order) {
      const [tabId, bodyId] = [freshId("tab"), freshId("place")];
      const tab = make(
        "button",
        { type: "button", role: "tab", id: tabId, "aria-controls": bodyId, onclick: () => this.showPlace(place) },
        PLACE_NAMES[place],
      );
      tab.addEventListener("keydown", (event) => {
        const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
        if (step === undefined) return;
        event.preventDefault();
        const next = order[(order.indexOf(place) + step + order.length) % order.length];
        this.showPlace(next);
        this.tabs.get(next)!.tab.focus();
      });
      const body = make("div", { role: "tabpanel", id: bodyId, "aria-labelledby": tabId }, bodies[place]!);
      this.tabs.set(place, { tab, body });
      list.append(tab);
      section.append(body);
    }
    return section;
  }

  private buildModel(): HTMLElement {
    const { model, host } = this;
    const rows: [string, string][] = [
      ["States", model.states.map(showName).join(",  ")],
      ["Parameters", model.params.map(({ name, value }) => `${showName(name)} = ${showNumber(value)}`).join(",  ")],
      ["Surfaces", model.surfaces.map(showExpression).join(",   ")],
      ["Actions", model.actions.join(", ")],
      ["Discrete states", model.discrete.join(", ")],
    ];
    const facts = make("dl", { class: "facts" });
    for (const [term, text] of rows) if (text) facts.append(make("dt", {}, term), make("dd", {}, text));
    this.editor = makeEditor({
      text: model.page.text,
      label:
        model.page.text === null
          ? "This model has come without a text. Another one: the right-hand side in Python"
          : "The right-hand side in Python",
      reader: () => (host.openModel ? host.reader() : Promise.resolve(null)),
      open: (bytes) => host.openModel?.(bytes),
    });
    return make("div", { class: "panel model" }, facts, this.editor.element);
  }

  private showPlace(place: Place): void {
    const chosen = this.tabs.has(place) ? place : "switches";
    this.state.place = chosen;
    if (chosen === "model") this.editor?.show();
    for (const [name, { tab, body }] of this.tabs) {
      const isChosen = name === chosen;
      tab.setAttribute("aria-selected", String(isChosen));
      tab.tabIndex = isChosen ? 0 : -1;
      body.hidden = !isChosen;
      const panel = this.panels.get(name);
      if (isChosen) panel?.show();
      else panel?.hide();
    }
  }

  private showValues(): void {
    for (const [name, value] of Object.entries(this.state.params)) this.sliders.get(`p ${name}`)?.set(value);
    this.state.y0.forEach((value, i) => this.sliders.get(`y ${i}`)?.set(value));
    this.sliders.get("t")?.set(this.state.t_span[1]);
  }

  private reset(): void {
    const fresh = initialState(this.model);
    Object.assign(this.state.params, fresh.params);
    this.state.y0.splice(0, this.model.n, ...fresh.y0);
    this.state.t_span = fresh.t_span;
    this.state.box = null;
    this.showValues();
    this.motion.clear();
    this.motion.update(false);
  }

  private ran(run: Run | null, words: string | null): void {
    this.status.classList.toggle("wrong", run !== null && !run.success);
    if (run === null) {
      this.status.textContent = words === null ? "stopped" : ""; // words stand where the pictures were
      if (words !== null)
        this.switches.replaceChildren(make("p", { class: "quiet" }, "There is no run to list switches of."));
    } else {
      this.status.textContent = describeRun(run);
      this.status.title = run.warnings.map(({ message }) => message).join("\n");
      showSwitches(this.switches, run, this.model.states, (t) => this.motion.mark(t));
    }
    for (const panel of this.panels.values()) panel.update();
    this.host.changed?.(this.state);
    this.root.dispatchEvent(new CustomEvent("filippov:ran", { bubbles: true, composed: true }));
  }

  private async share(): Promise<void> {
    const fragment = await this.fragment();
    const link = this.host.address + fragment;
    if (this.host.address === location.href.split("#")[0]) history.replaceState(null, "", fragment);
    const copied = await navigator.clipboard?.writeText(link).then(
      () => true,
      () => false,
    );
    this.say(copied ? `The link is copied: ${count(link.length, "letter")}.` : "The link stands in the address line.");
  }

  private say(words: string): void {
    this.notice.textContent = words;
    setTimeout(() => {
      if (this.notice.textContent === words) this.notice.textContent = "";
    }, 6000);
  }

  private toggleTheme(): void {
    this.hasChosenTheme = true;
    this.theme = this.theme === DARK ? LIGHT : DARK;
    this.applyTheme();
  }

  private applyTheme(): void {
    applyTheme(this.root, this.theme);
    const toggle = this.root.querySelector("button.theme");
    if (toggle) {
      toggle.textContent = this.theme === DARK ? "Light" : "Dark";
      toggle.setAttribute("title", `show it ${this.theme === DARK ? "light" : "dark"}`);
    }
    this.motion.redraw();
    for (const panel of this.panels.values()) panel.redraw();
  }
}

function describeRun(run: Run): string {
  const last = run.t[run.t.length - 1];
  const parts = [
    run.success ? `t = ${showNumber(last, 5)} reached` : run.message || `stopped at t = ${showNumber(last, 5)}`,
    count(run.switches.length, "switch", "switches"),
    count(run.steps, "step"),
  ];
  if (run.warnings.length) parts.push(`${count(run.warnings.length, "warning")}: ${run.warnings[0].message}`);
  return parts.join(" · ");
}
