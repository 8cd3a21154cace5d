/** The table of switches: what the pictures show, as text. */

import { showMode } from "./modes.ts";
import { count, showBeside, showExpression, showName, showNumber } from "./numbers.ts";
import type { Run } from "./replies.ts";

const ROWS_SHOWN = 100;

/** Fill an element with the table; pressing a row's time calls `go`. */
export function showSwitches(target: HTMLElement, run: Run, states: readonly string[], go: (t: number) => void): void {
  target.replaceChildren();
  if (run.switches.length === 0) {
    const words = document.createElement("p");
    words.className = "quiet";
    words.textContent = "The mode never changes in this time: there are no switches.";
    target.append(words);
    return;
  }
  const sizes = states.map((_, i) => run.switches.reduce((most, { y }) => Math.max(most, Math.abs(y[i])), 1e-3));
  const table = document.createElement("table");
  const caption = table.createCaption();
  caption.textContent = captionOf(run);
  const head = table.createTHead().insertRow();
  for (const title of ["time", "switch", "surface", "mode", ...states]) {
    const cell = document.createElement("th");
    cell.scope = "col";
    cell.textContent = states.includes(title) ? showName(title) : title;
    if (states.includes(title) || title === "time") cell.className = "number";
    if (states.includes(title)) cell.classList.add("name");
    head.append(cell);
  }
  const body = table.createTBody();
  for (const entry of run.switches.slice(0, ROWS_SHOWN)) {
    const row = body.insertRow();
    const button = document.createElement("button");
    button.type = "button";
    button.className = "plain";
    button.textContent = showNumber(entry.t, 8);
    button.title = "mark this instant in the pictures";
    button.onclick = () => go(entry.t);
    const time = row.insertCell();
    time.className = "number";
    time.append(button);
    row.insertCell().textContent = words(entry.kind) + (entry.note ? `, ${entry.note}` : "");
    const surface = row.insertCell();
    surface.className = "name";
    surface.textContent = entry.surfaces.map(showExpression).join(", ");
    row.insertCell().textContent =
      entry.from === entry.to ? showMode(entry.to) : `${showMode(entry.from)} → ${showMode(entry.to)}`;
    entry.y.forEach((value, i) => {
      const cell = row.insertCell();
      cell.className = "number";
      cell.textContent = showBeside(value, sizes[i], 7);
    });
  }
  target.append(table);
}

/** `enter_sliding` as words. */
export function words(kind: string): string {
  return kind.replaceAll("_", " ");
}

function captionOf(run: Run): string {
  const total = run.switches.length;
  const kinds = new Map<string, number>();
  for (const { kind } of run.switches) kinds.set(kind, (kinds.get(kind) ?? 0) + 1);
  const list = [...kinds].map(([kind, n]) => `${n} ${words(kind)}`).join(", ");
  const shown = total > ROWS_SHOWN ? `; the first ${ROWS_SHOWN} are listed, the file of the export has all` : "";
  return `${count(total, "switch", "switches")}: ${list}${shown}`;
}
