/** What the places below the pictures have in common. */

import type { Engines } from "./pool.ts";
import type { Drawing } from "./export.ts";
import { Job } from "./job.ts";
import type { Description, State } from "./model.ts";
import type { Picture } from "./picture.ts";
import type { Run } from "./replies.ts";
import type { Theme } from "./theme.ts";

/** What a place may know and do. */
export interface Context {
  readonly model: Description;
  readonly state: State;
  readonly engines: Engines;
  theme(): Theme;
  /** The window of the portrait. */
  window(): { readonly x: readonly [number, number]; readonly y: readonly [number, number] };
  /** The time and the state at the end of the run on the screen. */
  end(): { readonly t0: number; readonly y0: number[] } | null;
  /** Draw a cycle in the portrait, or take it away. */
  showCycle(run: Run | null): void;
  /** Start the motion elsewhere, as a click in a picture does. */
  start(y0: number[]): void;
  /** Set a parameter, as its slider does. */
  setParameter(name: string, value: number): void;
}

/** A picture that can be saved, as it is on the screen. */
export interface Saveable {
  readonly name: string;
  readonly width: number;
  readonly height: number;
  readonly draw: Drawing;
}

export interface NumbersFile {
  readonly name: string;
  text(): string;
}

export interface Panel {
  readonly element: HTMLElement;
  show(): void;
  hide(): void;
  /** The motion has changed: other parameters, another start. */
  update(): void;
  /** Colours have changed. */
  redraw(): void;
  saveables(): Saveable[];
  numbers(): NumbersFile[];
  /** Resolves when nothing is being computed. */
  settled(): Promise<void>;
  close(): void;
}

/** A place with one picture of work that can be stopped. */
export abstract class WorkPanel implements Panel {
  abstract readonly element: HTMLElement;
  protected abstract readonly picture: Picture;
  protected readonly job = new Job();

  abstract show(): void;
  abstract update(): void;
  abstract saveables(): Saveable[];
  abstract numbers(): NumbersFile[];

  hide(): void {}

  redraw(): void {
    this.picture.redraw();
  }

  settled(): Promise<void> {
    return this.job.settled();
  }

  close(): void {
    this.job.stop();
    this.picture.close();
  }
}

/** The words of a failure; `null` if it was stopped on purpose. */
export function wordsOf(error: unknown): string | null {
  const { name, message } = error as Error;
  if (name === "AbortError") return null;
  return message || String(error);
}
