/** Elements with fewer words. */

type Child = Node | string | null;

/** Make an element: `make("p", { class: "quiet" }, "text")`. Properties that start with `on` are listeners. */
export function make<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  given: Readonly<Record<string, string | number | boolean | ((event: never) => void)>> = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(given)) {
    if (typeof value === "function") element.addEventListener(name.slice(2), value as EventListener);
    else if (typeof value === "boolean") element.toggleAttribute(name, value);
    else element.setAttribute(name, String(value));
  }
  element.append(...children.filter((child): child is Node | string => child !== null));
  return element;
}

export function button(text: string, press: () => void, title = ""): HTMLButtonElement {
  return make("button", { type: "button", onclick: press, ...(title ? { title } : {}) }, text);
}

/** A choice among words; `press` receives the value. */
export function select(
  label: string,
  options: readonly (readonly [string, string])[],
  chosen: string,
  press: (value: string) => void,
): HTMLSelectElement {
  const element = make("select", { "aria-label": label });
  for (const [value, text] of options) element.append(make("option", { value }, text));
  element.value = chosen;
  element.addEventListener("change", () => press(element.value));
  return element;
}

let counter = 0;

/** A name that no other element of the page has. */
export function freshId(stem: string): string {
  return `filippov-${stem}-${++counter}`;
}
