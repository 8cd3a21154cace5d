/**
 * Colours and letters. The colours of curves are those of Okabe and Ito, Color Universal Design (2008), as in the
 * figures of the Python package; width, line style or shape repeat what colour shows.
 */

export interface Theme {
  readonly name: "light" | "dark";
  readonly ground: string;
  readonly raised: string;
  readonly ink: string;
  readonly muted: string;
  readonly faint: string;
  readonly hair: string;
  readonly accent: string;
  readonly colours: readonly string[];
  readonly attracting: string;
  readonly repelling: string;
  readonly crossing: string;
}

export const LIGHT: Theme = {
  name: "light",
  ground: "#ffffff",
  raised: "#f5f5f2",
  ink: "#1b1d22",
  muted: "#62676e",
  faint: "#b9bdc2",
  hair: "#e3e4e2",
  accent: "#0068a3",
  colours: ["#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#4d4d4d"],
  attracting: "#45456b",
  repelling: "#d55e00",
  crossing: "#8c8c8c",
};

export const DARK: Theme = {
  name: "dark",
  ground: "#16181d",
  raised: "#1f2228",
  ink: "#e8e8e6",
  muted: "#a0a5ac",
  faint: "#6a7078",
  hair: "#2c3038",
  accent: "#6cc0f0",
  colours: ["#56b4e9", "#e69f00", "#00a67d", "#cc79a7", "#2f7fce", "#ff7b39", "#f0e442"],
  attracting: "#bfc4f0",
  repelling: "#ff7b39",
  crossing: "#84888c",
};

export const SANS = "system-ui, -apple-system, 'Segoe UI', 'Helvetica Neue', 'Noto Sans', Arial, sans-serif";
export const SERIF = "'Iowan Old Style', 'Palatino Linotype', Palatino, 'URW Palladio L', 'Noto Serif', Georgia, serif";

export const SMOOTH_WIDTH = 1.5;
export const SLIDING_WIDTH = 3.4;

/** The custom properties of the style sheet. */
export function applyTheme(element: HTMLElement, theme: Theme): void {
  element.dataset.theme = theme.name;
  for (const name of ["ground", "raised", "ink", "muted", "faint", "hair", "accent"] as const) {
    element.style.setProperty(`--${name}`, theme[name]);
  }
  element.style.setProperty("--wrong", theme.repelling);
  element.style.setProperty("--sans", SANS);
  element.style.setProperty("--serif", SERIF);
  element.style.colorScheme = theme.name;
}
