/** Basins of attraction: each cell of the plane has the colour of the end of the run that starts there. */

import { drawAxes, frameIn, type Frame } from "./axes.ts";
import { readColour } from "./counts.ts";
import { drawKey, layKey, type KeyEntry } from "./key.ts";
import { circle, type Pen, type Raster } from "./pen.ts";
import type { Box } from "./portrait.ts";
import type { Basins } from "./replies.ts";
import type { Theme } from "./theme.ts";

export interface BasinsData {
  readonly basins: Basins | null;
  readonly box: Box;
  readonly labels: readonly [string, string];
  readonly start: readonly [number, number];
}

const SIDES = { left: 58, right: 16, top: 30 };
const BELOW_AXIS = 46;
const MOST_NAMED = 8;

export function drawBasins(pen: Pen, width: number, height: number, data: BasinsData, theme: Theme): Frame {
  const { basins } = data;
  const entries = basins ? keyEntries(basins, theme) : [];
  const key = layKey(pen, entries, width - SIDES.left - SIDES.right);
  const frame = frameIn(data.box.x, data.box.y, width, height, { ...SIDES, bottom: BELOW_AXIS + key.height });
  const [left, right] = frame.x.places;
  const [bottom, top] = frame.y.places;
  if (basins) pen.raster(colourCells(basins, theme), left, top, right - left, bottom - top);
  drawAxes(pen, frame, { xLabel: data.labels[0], yLabel: data.labels[1] }, { ...theme, hair: "transparent" });
  circle(pen, frame.x.at(data.start[0]), frame.y.at(data.start[1]), 5);
  pen.fillStyle = theme.ground;
  pen.fill();
  pen.strokeStyle = theme.ink;
  pen.lineWidth = 1.4;
  pen.stroke();
  drawKey(pen, entries, SIDES.left, height - key.height - 2, width - SIDES.left - SIDES.right, theme);
  return frame;
}

/** The colour of a basin; cells without an end are faint. */
function basinColour(label: number, theme: Theme): string {
  return label < 0 ? theme.faint : theme.colours[label % theme.colours.length];
}

/** The cells as a raster: their first row is the lowest. */
export function colourCells({ rows, columns, label }: Basins, theme: Theme): Raster {
  const pixels = new Uint8ClampedArray(4 * rows * columns);
  for (let row = 0; row < rows; row++) {
    for (let column = 0; column < columns; column++) {
      const cell = label[(rows - 1 - row) * columns + column];
      const [red, green, blue] = readColour(basinColour(cell, theme));
      pixels.set([red, green, blue, 235], 4 * (row * columns + column));
    }
  }
  return { width: columns, height: rows, pixels };
}

/** A letter for each end; after Z numbers follow. */
export function endName(k: number): string {
  return k < 26 ? String.fromCharCode(65 + k) : String(k + 1);
}

/** The share of the cells that go to an end, in percent. */
export function shareOf({ label }: Basins, k: number): number {
  return Math.round((100 * label.reduce((sum, cell) => sum + (cell === k ? 1 : 0), 0)) / label.length);
}

function keyEntries(basins: Basins, theme: Theme): KeyEntry[] {
  const square = (label: string, colour: string): KeyEntry => ({
    label,
    sample(pen, x, y) {
      pen.fillStyle = colour;
      pen.fillRect(x + 3, y - 6, 12, 12);
    },
  });
  const entries = basins.labels
    .slice(0, MOST_NAMED)
    .map((_, k) => square(`${endName(k)}, ${shareOf(basins, k)} %`, basinColour(k, theme)));
  if (basins.labels.length > MOST_NAMED) entries.push(square(`${basins.labels.length - MOST_NAMED} more`, theme.muted));
  if (basins.label.some((cell) => cell < 0)) entries.push(square("no end within the time", theme.faint));
  return entries;
}

/** The picture in a sentence. */
export function describeBasins(data: BasinsData): string {
  const { basins } = data;
  if (!basins) return "Basins: not computed yet.";
  const shares = basins.labels.map((label, k) => `${endName(k)}, ${label}: ${shareOf(basins, k)} %`);
  return `Basins over ${data.labels.join(" and ")}, ${basins.columns} by ${basins.rows} cells. ${shares.join("; ")}.`;
}
