/** A pen that writes SVG, so that the picture in the file is made by the routine that drew it on the screen. */

import type { Pen, Raster } from "./pen.ts";

/** What `save` keeps. */
const KEPT = [
  "strokeStyle",
  "fillStyle",
  "lineWidth",
  "lineCap",
  "lineJoin",
  "globalAlpha",
  "font",
  "textAlign",
  "textBaseline",
  "dash",
  "clips",
] as const;
type Kept = Pick<SvgPen, (typeof KEPT)[number]>;

const FULL_TURN = 2 * Math.PI;
const ANCHORS: Partial<Record<CanvasTextAlign, string>> = { center: "middle", right: "end", end: "end" };

export class SvgPen implements Pen {
  strokeStyle: Pen["strokeStyle"] = "#000";
  fillStyle: Pen["fillStyle"] = "#000";
  lineWidth = 1;
  lineCap: CanvasLineCap = "butt";
  lineJoin: CanvasLineJoin = "miter";
  globalAlpha = 1;
  font = "10px sans-serif";
  textAlign: CanvasTextAlign = "start";
  textBaseline: CanvasTextBaseline = "alphabetic";
  dash: readonly number[] = [];
  /** Groups with a clip that are open. */
  clips = 0;
  private readonly kept: Kept[] = [];
  private readonly body: string[] = [];
  private readonly clipPaths = new Map<string, string>();
  private path: string[] = [];

  /** `embed` gives the address of a raster, `data:image/png;base64,..`. */
  constructor(
    private readonly width: number,
    private readonly height: number,
    private readonly embed: (raster: Raster) => string,
  ) {}

  save(): void {
    this.kept.push(Object.fromEntries(KEPT.map((name) => [name, this[name]])) as unknown as Kept);
  }

  restore(): void {
    const before = this.kept.pop();
    if (!before) return;
    this.body.push("</g>".repeat(this.clips - before.clips));
    Object.assign(this, before);
  }

  beginPath(): void {
    this.path = [];
  }

  closePath(): void {
    this.path.push("Z");
  }

  moveTo(x: number, y: number): void {
    this.path.push(`M${short(x)} ${short(y)}`);
  }

  lineTo(x: number, y: number): void {
    this.path.push(`${this.path.length === 0 ? "M" : "L"}${short(x)} ${short(y)}`);
  }

  arc(x: number, y: number, radius: number, from: number, to: number): void {
    const at = (angle: number) => `${short(x + radius * Math.cos(angle))} ${short(y + radius * Math.sin(angle))}`;
    const turn = Math.min(to - from, FULL_TURN);
    const bend = `A${short(radius)} ${short(radius)} 0 0 1 `;
    this.path.push(`${this.path.length === 0 ? "M" : "L"}${at(from)}`);
    // halves, for one arc of SVG cannot go all the way round
    this.path.push(bend + at(from + turn / 2), bend + at(from + turn));
  }

  rect(x: number, y: number, width: number, height: number): void {
    this.path.push(`M${short(x)} ${short(y)}h${short(width)}v${short(height)}h${short(-width)}Z`);
  }

  clip(): void {
    const path = this.path.join("");
    const id = `clip${hash(path)}`;
    this.clipPaths.set(id, path);
    this.body.push(`<g clip-path="url(#${id})">`);
    this.clips += 1;
  }

  stroke(): void {
    const { strokeStyle, lineWidth, lineCap, lineJoin, dash } = this;
    const extra = [
      lineCap === "butt" ? "" : ` stroke-linecap="${lineCap}"`,
      lineJoin === "miter" ? "" : ` stroke-linejoin="${lineJoin}"`,
      dash.length ? ` stroke-dasharray="${dash.map(short).join(" ")}"` : "",
    ].join("");
    this.add(
      `<path d="${this.path.join("")}" fill="none" stroke="${strokeStyle}" stroke-width="${short(lineWidth)}"${extra}`,
      "/>",
    );
  }

  fill(): void {
    this.add(`<path d="${this.path.join("")}" fill="${this.fillStyle}"`, "/>");
  }

  fillRect(x: number, y: number, width: number, height: number): void {
    this.add(
      `<rect x="${short(x)}" y="${short(y)}" width="${short(width)}" height="${short(height)}" fill="${this.fillStyle}"`,
      "/>",
    );
  }

  fillText(text: string, x: number, y: number): void {
    const { style, size, family } = readFont(this.font);
    const down = { middle: 0.35, top: 0.8, hanging: 0.8 }[this.textBaseline as string] ?? 0;
    const anchor = ANCHORS[this.textAlign];
    this.add(
      `<text x="${short(x)}" y="${short(y + down * size)}" font-size="${size}" font-family="${escape(family)}"` +
        (style ? ` font-style="${style}"` : "") +
        (anchor ? ` text-anchor="${anchor}"` : "") +
        ` fill="${this.fillStyle}" xml:space="preserve"`,
      `>${escape(text)}</text>`,
    );
  }

  /** About the width of the text: no letters are laid out here. */
  measureText(text: string): { readonly width: number } {
    return { width: 0.56 * readFont(this.font).size * text.length };
  }

  setLineDash(pattern: number[]): void {
    this.dash = pattern;
  }

  raster(raster: Raster, x: number, y: number, width: number, height: number): void {
    this.add(
      `<image x="${short(x)}" y="${short(y)}" width="${short(width)}" height="${short(height)}" ` +
        `preserveAspectRatio="none" style="image-rendering:pixelated" href="${this.embed(raster)}"`,
      "/>",
    );
  }

  /** The file. */
  toString(): string {
    const paths = [...this.clipPaths];
    const clips = paths.map(([id, path]) => `<clipPath id="${id}"><path d="${path}"/></clipPath>`).join("");
    const open = this.clips > 0 ? "</g>".repeat(this.clips) : "";
    return (
      `<svg xmlns="http://www.w3.org/2000/svg" width="${this.width}" height="${this.height}" ` +
      `viewBox="0 0 ${this.width} ${this.height}"><defs>${clips}</defs>\n${this.body.join("\n")}${open}\n</svg>\n`
    );
  }

  private add(start: string, end: string): void {
    const alpha = this.globalAlpha < 1 ? ` opacity="${short(this.globalAlpha)}"` : "";
    this.body.push(start + alpha + end);
  }
}

/** A name that is the same for the same path only: several files may stand in one page. */
function hash(text: string): string {
  let value = 0;
  for (const letter of text) value = (Math.imul(value, 31) + letter.charCodeAt(0)) | 0;
  return (value >>> 0).toString(36);
}

function short(value: number): string {
  return String(Math.round(value * 100) / 100);
}

function readFont(font: string): { style: string; size: number; family: string } {
  const [, style, size, family] = /^(italic )?([\d.]+)px (.+)$/.exec(font) ?? [];
  return { style: style?.trim() ?? "", size: Number(size ?? 10), family: family ?? "sans-serif" };
}

function escape(text: string): string {
  return text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;").replaceAll('"', "&quot;");
}
