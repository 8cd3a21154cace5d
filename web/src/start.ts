/** The page before there is a model: a text of one's own, and the reference problems. */

import { button, make } from "./dom.ts";
import { makeEditor, type TextReader } from "./editor.ts";
import { applyTheme, DARK, LIGHT } from "./theme.ts";

export interface Problem {
  readonly name: string;
  readonly title: string;
  /** What happens in it. */
  readonly note?: string;
}

export interface StartOptions {
  readonly problems: readonly Problem[];
  reader(): Promise<TextReader | null>;
  openProblem(name: string): void;
  openModel(model: Uint8Array): void;
}

/** Put the page without a model into an element. */
export function showStart(root: HTMLElement, { problems, reader, openProblem, openModel }: StartOptions): void {
  const scheme = window.matchMedia("(prefers-color-scheme: dark)");
  root.classList.add("filippov");
  applyTheme(root, scheme.matches ? DARK : LIGHT);
  const editor = makeEditor({ text: null, label: "The right-hand side in Python", reader, open: openModel });
  const rows = problems.flatMap(({ name, title, note }) => [
    make("dt", {}, button(title, () => openProblem(name))),
    make("dd", {}, note ?? ""),
  ]);
  const list = make(
    "section",
    { class: "problems" },
    make("h2", {}, "Or open a reference problem"),
    make("dl", {}, ...rows),
  );
  root.replaceChildren(
    make("header", {}, make("h1", {}, "filippov")),
    make(
      "p",
      { class: "lead" },
      "Systems whose right-hand side jumps: friction, relays, impacts. Write one, and look at its motion, its phase portrait, its sections and diagrams.",
    ),
    make(
      "div",
      { class: "start" },
      make("section", { class: "own" }, make("h2", {}, "Write a system"), editor.element),
      problems.length > 0 ? list : null,
    ),
  );
  editor.show();
}
