/** Very many points as a raster of counts, whose density is shade. */

import type { Frame } from "./axes.ts";
import type { Raster } from "./pen.ts";

/** Points that grow in number: two columns of floats with room to spare. */
export class Points {
  private columns: [Float64Array, Float64Array] = [new Float64Array(1024), new Float64Array(1024)];
  length = 0;

  add(x: ArrayLike<number>, y: ArrayLike<number>): void {
    const needed = this.length + x.length;
    if (needed > this.columns[0].length) {
      const size = Math.max(needed, 2 * this.columns[0].length);
      this.columns = this.columns.map((old) => {
        const grown = new Float64Array(size);
        grown.set(old.subarray(0, this.length));
        return grown;
      }) as [Float64Array, Float64Array];
    }
    this.columns[0].set(x, this.length);
    this.columns[1].set(y, this.length);
    this.length = needed;
  }

  get x(): Float64Array {
    return this.columns[0].subarray(0, this.length);
  }

  get y(): Float64Array {
    return this.columns[1].subarray(0, this.length);
  }

  /** Keep the points whose first coordinate lies in an interval. */
  keepWithin(low: number, high: number): void {
    const [x, y] = this.columns;
    let kept = 0;
    for (let k = 0; k < this.length; k++) {
      if (!(x[k] >= low && x[k] <= high)) continue;
      x[kept] = x[k];
      y[kept++] = y[k];
    }
    this.length = kept;
  }

  clear(): void {
    this.length = 0;
  }
}

export interface Counts {
  readonly width: number;
  readonly height: number;
  readonly cells: Uint32Array;
  readonly most: number;
}

const SPARSE = 0.02; // of the pixels: points that are so few are drawn as blocks of 2 x 2

/** Count the points in each pixel of the frame, `resolution` pixels for one of the page's. */
export function countPoints(points: Points, frame: Frame, resolution: number): Counts {
  const [left, right] = frame.x.places;
  const [bottom, top] = frame.y.places;
  const width = Math.max(1, Math.round((right - left) * resolution));
  const height = Math.max(1, Math.round((bottom - top) * resolution));
  const cells = new Uint32Array(width * height);
  const { x, y } = points;
  const slopeX = width / (frame.x.values[1] - frame.x.values[0]);
  const slopeY = height / (frame.y.values[1] - frame.y.values[0]);
  const [fromX, toY] = [frame.x.values[0], frame.y.values[1]];
  let [most, occupied] = [0, 0];
  for (let k = 0; k < x.length; k++) {
    const column = Math.floor((x[k] - fromX) * slopeX);
    const row = Math.floor((toY - y[k]) * slopeY);
    if (!(column >= 0 && column < width && row >= 0 && row < height)) continue;
    const n = ++cells[row * width + column];
    if (n === 1) occupied++;
    if (n > most) most = n;
  }
  const counts = { width, height, cells, most };
  return occupied < SPARSE * cells.length ? widened(counts, Math.ceil(resolution)) : counts;
}

/** Each point a block of pixels, so that few points can be seen. */
function widened({ width, height, cells, most }: Counts, by: number): Counts {
  const wide = new Uint32Array(cells.length);
  for (let row = 0; row < height; row++) {
    for (let column = 0; column < width; column++) {
      const n = cells[row * width + column];
      if (n === 0) continue;
      const [lastRow, lastColumn] = [Math.min(row + by, height - 1), Math.min(column + by, width - 1)];
      for (let r = row; r <= lastRow; r++) {
        for (let c = column; c <= lastColumn; c++) wide[r * width + c] = Math.max(wide[r * width + c], n);
      }
    }
  }
  return { width, height, cells: wide, most };
}

const FAINTEST = 0.45;

/** Shade the counts: opacity grows with their logarithm, and a single point can be seen. */
export function shade({ width, height, cells, most }: Counts, colour: string): Raster {
  const [red, green, blue] = readColour(colour);
  const pixels = new Uint8ClampedArray(4 * cells.length);
  const scale = most > 1 ? (1 - FAINTEST) / Math.log(most) : 0;
  const opacity = new Uint8Array(Math.min(most, 4096) + 1);
  for (let n = 1; n < opacity.length; n++) opacity[n] = 255 * (most > 1 ? FAINTEST + scale * Math.log(n) : 0.9);
  for (let k = 0; k < cells.length; k++) {
    const n = cells[k];
    if (n === 0) continue;
    pixels[4 * k] = red;
    pixels[4 * k + 1] = green;
    pixels[4 * k + 2] = blue;
    pixels[4 * k + 3] = n < opacity.length ? opacity[n] : 255;
  }
  return { width, height, pixels };
}

/** Red, green and blue of `#rrggbb`. */
export function readColour(colour: string): [number, number, number] {
  const value = Number.parseInt(colour.slice(1), 16);
  return [(value >> 16) & 255, (value >> 8) & 255, value & 255];
}
