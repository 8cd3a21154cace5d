/** Numbers as people read them. */

const MINUS = "−";
const DIGITS = 6;

/** A number with at most six digits, without zeros at its end. */
export function showNumber(value: number, digits = DIGITS): string {
  if (!Number.isFinite(value)) return Number.isNaN(value) ? "—" : value > 0 ? "∞" : `${MINUS}∞`;
  return withMinus(plainNumber(value, digits));
}

/** A number among others: what is nothing beside the largest of them is 0. */
export function showBeside(value: number, largest: number, digits = DIGITS): string {
  return showNumber(Math.abs(value) < 1e-12 * largest ? 0 : value, digits);
}

/** The same as the field of a form takes it. */
export function plainNumber(value: number, digits = DIGITS): string {
  return String(Number(value.toPrecision(digits)));
}

/** A number with a fixed number of decimals. */
export function showFixed(value: number, decimals: number): string {
  return withMinus(value.toFixed(decimals));
}

export function withMinus(text: string): string {
  return text.replaceAll("-", MINUS);
}

/** `1 switch`, `3 switches`. */
export function count(n: number, one: string, many = `${one}s`): string {
  return `${n} ${n === 1 ? one : many}`;
}

const GREEK: Readonly<Record<string, string>> = {
  alpha: "α",
  beta: "β",
  gamma: "γ",
  delta: "δ",
  epsilon: "ε",
  eps: "ε",
  zeta: "ζ",
  eta: "η",
  theta: "θ",
  kappa: "κ",
  lam: "λ",
  pi: "π",
  mu: "μ",
  nu: "ν",
  xi: "ξ",
  rho: "ρ",
  sigma: "σ",
  tau: "τ",
  phi: "φ",
  chi: "χ",
  psi: "ψ",
  omega: "ω",
  Gamma: "Γ",
  Delta: "Δ",
  Theta: "Θ",
  Lambda: "Λ",
  Sigma: "Σ",
  Phi: "Φ",
  Psi: "Ψ",
  Omega: "Ω",
};
const BELOW = "₀₁₂₃₄₅₆₇₈₉";

/** A name as it is printed in a text: `omega` is ω, digits at its end, as in `x1` and `x[1]`, stand below the line. */
export function showName(name: string): string {
  const plain = /^([A-Za-z]+)_?(\d{0,2})$/.exec(name) ?? /^([A-Za-z]+)\[(\d{1,2})\]$/.exec(name);
  if (plain === null) return name;
  const [, letters, digits] = plain;
  return (GREEK[letters] ?? letters) + [...digits].map((digit) => BELOW[Number(digit)]).join("");
}

/** A printed expression as a text has it: `S - 0.8*T - eps` is S − 0.8 T − ε. */
export function showExpression(text: string): string {
  return text
    .replace(/[A-Za-z_]\w*(?:\[\d+\])?/g, showName)
    .replaceAll("**2", "²")
    .replaceAll("**3", "³")
    .replace(/(?<!\*)\*(?!\*)/g, "\u2009")
    .replaceAll("-", MINUS);
}
