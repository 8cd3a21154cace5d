/** The values of a sweep in parts, in an order in which the picture is whole at once and becomes denser. */

/** `n` values from one end of the interval to the other. */
export function evenly([low, high]: readonly [number, number], n: number): number[] {
  return Array.from({ length: n }, (_, k) => (n === 1 ? low : low + ((high - low) * k) / (n - 1)));
}

/** Every 16th value first, then those in the middle between them, and so on. */
export function coarseToFine(values: readonly number[]): number[] {
  const order: number[] = [];
  const taken = new Set<number>();
  for (let stride = 16; stride >= 1; stride /= 2) {
    for (let k = 0; k < values.length; k += stride) {
      if (taken.has(k)) continue;
      taken.add(k);
      order.push(values[k]);
    }
  }
  return order;
}

export function chunks<T>(items: readonly T[], size: number): T[][] {
  const parts: T[][] = [];
  for (let k = 0; k < items.length; k += size) parts.push(items.slice(k, k + size));
  return parts;
}
