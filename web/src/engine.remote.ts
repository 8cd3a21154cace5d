/** Engines of the kernel: over HTTP to `filippov app`, or over the messages of a notebook's widget. */

import type { Engine, Request } from "./engine.ts";
import { EngineError, readReply, type Reply } from "./wire.ts";

/** `POST /ask` of the local server, with its token. */
export class HttpEngine implements Engine {
  constructor(
    private readonly address: string,
    private readonly token: string,
    readonly kinds: ReadonlySet<string>,
  ) {}

  async ask(request: Request, signal?: AbortSignal): Promise<Reply> {
    let response: Response;
    try {
      response = await fetch(this.address, {
        method: "POST",
        body: JSON.stringify(request),
        headers: { "Content-Type": "application/json", "X-Filippov-Token": this.token },
        signal: signal ?? null,
      });
    } catch (error) {
      if (signal?.aborted) throw error;
      throw new EngineError("The local server does not answer: is `filippov app` still running?", "server");
    }
    if (!response.ok)
      throw new EngineError((await response.text()) || `the local server refused (${response.status})`, "server");
    return readReply(new Uint8Array(await response.arrayBuffer()));
  }

  close(): void {}
}

/** The part of an anywidget's model that the engine uses. */
export interface Comm {
  send(content: unknown, callbacks?: unknown, buffers?: (ArrayBuffer | ArrayBufferView)[]): void;
  on(name: "msg:custom", callback: (content: unknown, buffers: DataView[]) => void): void;
  off(name: "msg:custom", callback: (content: unknown, buffers: DataView[]) => void): void;
}

interface Waiting {
  resolve(reply: Reply): void;
  reject(reason: unknown): void;
}

/** Messages `{kind: "ask", id, request}` to the kernel; `{kind: "reply", id}` with one buffer come back. */
export class CommEngine implements Engine {
  private readonly waiting = new Map<number, Waiting>();
  private next = 1;

  constructor(
    private readonly comm: Comm,
    readonly kinds: ReadonlySet<string>,
  ) {
    comm.on("msg:custom", this.receive);
  }

  ask(request: Request, signal?: AbortSignal): Promise<Reply> {
    signal?.throwIfAborted();
    const id = this.next++;
    return new Promise((resolve, reject) => {
      this.waiting.set(id, { resolve, reject });
      signal?.addEventListener(
        "abort",
        () => {
          if (this.waiting.delete(id)) reject(signal.reason);
        },
        { once: true },
      );
      this.comm.send({ kind: "ask", id, request });
    });
  }

  close(): void {
    this.comm.off("msg:custom", this.receive);
    for (const { reject } of this.waiting.values()) reject(new EngineError("the widget was closed", "closed"));
    this.waiting.clear();
  }

  private readonly receive = (content: unknown, buffers: DataView[]): void => {
    const { kind, id, error } = content as { kind?: string; id?: number; error?: string };
    const waiting = kind === "reply" && id !== undefined ? this.waiting.get(id) : undefined;
    if (!waiting) return;
    this.waiting.delete(id!);
    try {
      if (error !== undefined) throw new EngineError(error, "kernel");
      const view = buffers[0];
      waiting.resolve(readReply(new Uint8Array(view.buffer, view.byteOffset, view.byteLength)));
    } catch (reason) {
      waiting.reject(reason);
    }
  };
}
