/** Files: pictures as PNG and SVG, numbers as CSV. */

import { canvasPen, rasterCanvas, type Pen } from "./pen.ts";
import { SvgPen } from "./recorder.ts";
import type { Run } from "./replies.ts";
import type { Theme } from "./theme.ts";

export type Drawing = (pen: Pen, width: number, height: number, theme: Theme) => void;

const PIXELS = 3; // for one of the page's

export function writeSvg(draw: Drawing, width: number, height: number, theme: Theme): string {
  const pen = new SvgPen(width, height, (raster) => rasterCanvas(raster).toDataURL("image/png"));
  pen.fillStyle = theme.ground;
  pen.fillRect(0, 0, width, height);
  draw(pen, width, height, theme);
  return pen.toString();
}

export async function writePng(draw: Drawing, width: number, height: number, theme: Theme): Promise<Blob> {
  const canvas = document.createElement("canvas");
  canvas.width = Math.round(width * PIXELS);
  canvas.height = Math.round(height * PIXELS);
  const context = canvas.getContext("2d")!;
  context.scale(PIXELS, PIXELS);
  context.fillStyle = theme.ground;
  context.fillRect(0, 0, width, height);
  draw(canvasPen(context), width, height, theme);
  return await new Promise((resolve, reject) =>
    canvas.toBlob((blob) => (blob ? resolve(blob) : reject(new Error("the browser made no PNG"))), "image/png"),
  );
}

/** The points of the curve: `t`, the states, the mode. All digits are written. */
export function curveCsv(run: Run, states: readonly string[]): string {
  const rows = [["t", ...states, "mode"].map(cell).join(",")];
  for (const piece of run.pieces) {
    for (let row = piece.first; row <= piece.last; row++) {
      const y = Array.from(run.y.subarray(row * run.n, (row + 1) * run.n), String);
      rows.push([String(run.t[row]), ...y, cell(piece.mode)].join(","));
    }
  }
  return `${rows.join("\n")}\n`;
}

/** The switches as a table. */
export function switchesCsv(run: Run, states: readonly string[]): string {
  const rows = [["t", "kind", "surfaces", "mode_before", "mode_after", ...states].map(cell).join(",")];
  for (const entry of run.switches) {
    const cells = [
      String(entry.t),
      entry.kind,
      entry.surfaces.join("; "),
      entry.from,
      entry.to,
      ...entry.y.map(String),
    ];
    rows.push(cells.map(cell).join(","));
  }
  return `${rows.join("\n")}\n`;
}

/** Points of a section or of a diagram. */
export function pointsCsv(names: readonly string[], columns: readonly ArrayLike<number>[]): string {
  const rows = [names.map(cell).join(",")];
  for (let k = 0; k < (columns[0]?.length ?? 0); k++) rows.push(columns.map((column) => String(column[k])).join(","));
  return `${rows.join("\n")}\n`;
}

/** Quotes where a comma, a quote or a line break needs them. */
function cell(text: string): string {
  return /[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}

/** Hand a file to the user. */
export function save(name: string, content: string | Blob, type = "text/plain"): void {
  const blob = typeof content === "string" ? new Blob([content], { type: `${type};charset=utf-8` }) : content;
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}
