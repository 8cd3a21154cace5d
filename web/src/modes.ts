/** Modes as sign vectors, `+0-`: their order, their names, and their colours. */

import { showExpression } from "./numbers.ts";
import type { Theme } from "./theme.ts";

/** With so many surfaces every mode has its place among all, and so many modes there are then. */
const MOST_SURFACES_OF_ALL = 2;
const ALL_MODES = 9;

/** Rows of Pascal's triangle modulo `modulus`. */
function binomials(n: number, modulus: number): number[][] {
  const rows: number[][] = [];
  for (let i = 0; i <= n; i++) {
    const row = [1];
    for (let k = 1; k <= i; k++) row.push((rows[i - 1][k - 1] + (rows[i - 1][k] ?? 0)) % modulus);
    rows.push(row);
  }
  return rows;
}

/**
 * The place of a mode among all modes of as many surfaces, modulo a number.
 *
 * Regions come first, then sliding on one surface, on two, ..; within these `+` comes before `0` and `-`, as in the
 * figures of the Python package.
 */
export function modeRank(mode: string, modulus: number): number {
  const m = mode.length;
  const choose = binomials(m, modulus);
  // 2^(regions left) for every choice of the surfaces slid on
  const count = (length: number, zeros: number): number => {
    if (zeros < 0 || zeros > length) return 0;
    let power = 1;
    for (let k = 0; k < length - zeros; k++) power = (2 * power) % modulus;
    return ((choose[length][zeros] ?? 0) * power) % modulus;
  };
  const codimension = countZeros(mode);
  let rank = 0;
  for (let c = 0; c < codimension; c++) rank += count(m, c);
  let left = codimension;
  for (let i = 0; i < m; i++) {
    const after = m - 1 - i;
    if (mode[i] === "+") continue;
    rank += count(after, left); // those with + here
    if (mode[i] === "-") rank += count(after, left - 1); // and those with 0
    if (mode[i] === "0") left -= 1;
  }
  return rank % modulus;
}

/** How far colours after the seventh are mixed with the ink, and those after the fourteenth with the ground. */
const SHADES = [0, 0.45, 0.5];

/**
 * The numbers of modes: no two modes in one picture share a colour, and a mode keeps its own while the page is open.
 *
 * With one surface or two a mode has its place among all modes, so that its colour is the same in every picture. With more
 * surfaces there are too many: the modes of the first run are numbered in their order, and others as they come.
 */
export class ModeNumbers {
  private readonly numbers = new Map<string, number>();

  /** Number the modes of a run. */
  note(modes: Iterable<string>): void {
    for (const mode of sortModes(modes)) {
      if (this.numbers.has(mode)) continue;
      const number = mode.length <= MOST_SURFACES_OF_ALL ? modeRank(mode, ALL_MODES) : this.numbers.size;
      this.numbers.set(mode, number);
    }
  }

  /** The colour of a mode; the faint ink if there are no more. */
  colour(mode: string, theme: Theme): string {
    this.note([mode]);
    const number = this.numbers.get(mode)!;
    const level = Math.floor(number / theme.colours.length);
    if (level >= SHADES.length) return theme.faint;
    const own = theme.colours[number % theme.colours.length];
    return level === 0 ? own : mix(own, level === 2 ? theme.ground : theme.ink, SHADES[level]);
  }
}

/** Two colours `#rrggbb`, mixed. */
function mix(a: string, b: string, share: number): string {
  const parts = (colour: string) => [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16));
  const [from, to] = [parts(a), parts(b)];
  const mixed = from.map((value, k) => Math.round((1 - share) * value + share * to[k]));
  return `#${mixed.map((value) => value.toString(16).padStart(2, "0")).join("")}`;
}

export function isSliding(mode: string): boolean {
  return mode.includes("0");
}

/** Modes sorted as their colours are: regions first. */
export function sortModes(modes: Iterable<string>): string[] {
  const key = (mode: string) => [...mode].map((sign) => "+0-".indexOf(sign)).join("");
  return [...new Set(modes)].sort((a, b) => countZeros(a) - countZeros(b) || (key(a) < key(b) ? -1 : 1));
}

/** The mode as people read it: a true minus sign. */
export function showMode(mode: string): string {
  return mode === "" ? "smooth" : mode.replaceAll("-", "−");
}

const LONGEST_SURFACE = 24;

/** The mode in words if there is one surface with a short name: `v > 0`. */
export function explainMode(mode: string, surfaces: readonly string[]): string {
  if (mode.length !== 1 || surfaces.length !== 1 || surfaces[0].length > LONGEST_SURFACE) {
    return isSliding(mode) ? `${showMode(mode)}  sliding` : showMode(mode);
  }
  const sign = { "+": ">", "-": "<", "0": "=" }[mode];
  return `${showMode(mode)}  ${showExpression(surfaces[0])} ${sign} 0${mode === "0" ? ", sliding" : ""}`;
}

function countZeros(mode: string): number {
  return [...mode].filter((sign) => sign === "0").length;
}
