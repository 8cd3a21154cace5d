/** Modes as sign vectors, `+0-`: their order, their names, and their colours, which are the same in every run. */

import { showExpression } from "./numbers.ts";

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
 * The place of a mode among all modes of as many surfaces, modulo the number of colours.
 *
 * Regions come first, then sliding on one surface, on two, ..; within these `+` comes before `0` and `-`, as in the
 * figures of the Python package. Modulo the seven colours two regions with a common surface never agree, for 7
 * divides no power of two.
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

export function modeColour(mode: string, colours: readonly string[]): string {
  return colours[modeRank(mode, colours.length)];
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
