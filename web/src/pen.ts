/** What pictures are drawn with: the part of a canvas context that they use, and rasters. A file can take its place. */

import { SANS, SERIF } from "./theme.ts";

/** A raster of colours, four bytes a pixel, row by row from the top. */
export interface Raster {
  readonly width: number;
  readonly height: number;
  readonly pixels: Uint8ClampedArray;
}

export interface Pen {
  strokeStyle: string | CanvasGradient | CanvasPattern;
  fillStyle: string | CanvasGradient | CanvasPattern;
  lineWidth: number;
  lineCap: CanvasLineCap;
  lineJoin: CanvasLineJoin;
  globalAlpha: number;
  font: string;
  textAlign: CanvasTextAlign;
  textBaseline: CanvasTextBaseline;
  save(): void;
  restore(): void;
  beginPath(): void;
  closePath(): void;
  moveTo(x: number, y: number): void;
  lineTo(x: number, y: number): void;
  arc(x: number, y: number, radius: number, from: number, to: number): void;
  rect(x: number, y: number, width: number, height: number): void;
  clip(): void;
  stroke(): void;
  fill(): void;
  fillRect(x: number, y: number, width: number, height: number): void;
  fillText(text: string, x: number, y: number): void;
  measureText(text: string): { readonly width: number };
  setLineDash(pattern: number[]): void;
  raster(raster: Raster, x: number, y: number, width: number, height: number): void;
}

/** The pen of a canvas. */
export function canvasPen(context: CanvasRenderingContext2D): Pen {
  return Object.assign(context, {
    raster(raster: Raster, x: number, y: number, width: number, height: number) {
      context.imageSmoothingEnabled = false;
      context.drawImage(rasterCanvas(raster), x, y, width, height);
    },
  });
}

/** A canvas that holds a raster. */
export function rasterCanvas({ width, height, pixels }: Raster): HTMLCanvasElement {
  const canvas = document.createElement("canvas");
  canvas.width = width;
  canvas.height = height;
  const image = new ImageData(pixels as Uint8ClampedArray<ArrayBuffer>, width, height);
  canvas.getContext("2d")!.putImageData(image, 0, 0);
  return canvas;
}

/** Choose letters: upright sans for numbers and words, italic serif for names of quantities. */
export function setFont(pen: Pen, size: number, kind: "word" | "name" = "word"): void {
  pen.font = kind === "name" ? `italic ${size}px ${SERIF}` : `${size}px ${SANS}`;
}

export function circle(pen: Pen, x: number, y: number, radius: number): void {
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  pen.closePath();
}
