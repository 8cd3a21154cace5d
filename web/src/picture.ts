/** A canvas that keeps its real pixels, is redrawn when it has to be, and shows words where it has no picture. */

import { canvasPen, type Pen } from "./pen.ts";
import type { Theme } from "./theme.ts";

export type Paint = (pen: Pen, width: number, height: number, theme: Theme) => void;

export class Picture {
  readonly element: HTMLElement;
  readonly canvas: HTMLCanvasElement;
  private readonly words: HTMLParagraphElement;
  private readonly pen: Pen;
  private readonly context: CanvasRenderingContext2D;
  private readonly observer: ResizeObserver;
  private scheduled = 0;
  width = 0;
  height = 0;

  /** `paint` draws; `theme` gives the colours of the moment. */
  constructor(
    name: string,
    private readonly paint: Paint,
    private readonly theme: () => Theme,
    private readonly sentence: () => string,
  ) {
    this.element = document.createElement("div");
    this.element.className = `picture ${name}`;
    this.canvas = document.createElement("canvas");
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", name);
    this.words = document.createElement("p");
    this.words.className = "words";
    this.words.setAttribute("role", "status");
    this.words.hidden = true;
    this.element.append(this.canvas, this.words);
    this.context = this.canvas.getContext("2d")!;
    this.pen = canvasPen(this.context);
    this.observer = new ResizeObserver(() => this.resize());
    this.observer.observe(this.element);
  }

  /** Device pixels for one of the page's. */
  get resolution(): number {
    return Math.max(1, window.devicePixelRatio || 1);
  }

  /** Show words instead of the picture; `null` shows the picture. */
  say(words: string | null): void {
    this.words.hidden = words === null;
    this.words.textContent = words ?? "";
    this.canvas.classList.toggle("covered", words !== null);
    if (words !== null) this.canvas.setAttribute("aria-label", words);
  }

  /** Draw before the next frame, once however often it is asked. */
  redraw(): void {
    if (this.scheduled) return;
    this.scheduled = requestAnimationFrame(() => this.draw());
  }

  draw(): void {
    cancelAnimationFrame(this.scheduled);
    this.scheduled = 0;
    if (this.width < 1 || this.height < 1) return;
    const { context, resolution } = this;
    context.setTransform(resolution, 0, 0, resolution, 0, 0);
    const theme = this.theme();
    context.fillStyle = theme.ground;
    context.fillRect(0, 0, this.width, this.height);
    context.save();
    this.paint(this.pen, this.width, this.height, theme);
    context.restore();
    if (this.words.hidden) this.canvas.setAttribute("aria-label", this.sentence());
  }

  /** The place of a pointer in the picture. */
  place(event: MouseEvent): { x: number; y: number } {
    const box = this.canvas.getBoundingClientRect();
    return {
      x: ((event.clientX - box.left) * this.width) / box.width,
      y: ((event.clientY - box.top) * this.height) / box.height,
    };
  }

  close(): void {
    this.observer.disconnect();
    cancelAnimationFrame(this.scheduled);
  }

  private resize(): void {
    const { clientWidth, clientHeight } = this.element;
    const { resolution } = this;
    this.width = clientWidth;
    this.height = clientHeight;
    const [pixels, rows] = [Math.round(clientWidth * resolution), Math.round(clientHeight * resolution)];
    if (this.canvas.width === pixels && this.canvas.height === rows) return;
    this.canvas.width = pixels;
    this.canvas.height = rows;
    this.draw();
  }
}
