/** Engines in workers: one that can be stopped, and several for work in many parts. */

import { WASM_KINDS, WasmEngine, type Engine, type Request } from "./engine.ts";
import type { FromWorker } from "./engine.worker.ts";
import { EngineError, readReply, type Reply } from "./wire.ts";

/** The text of `engine.worker.ts`, put in by the build. */
declare const WORKER_TEXT: string;

const MOST_WORKERS = 8;

interface Waiting {
  resolve(reply: Reply): void;
  reject(reason: unknown): void;
}

/**
 * An engine in a worker. A request whose signal is aborted while it runs ends the worker, for a computation
 * cannot be interrupted otherwise; the next request starts another one.
 */
export class WorkerEngine implements Engine {
  readonly kinds = WASM_KINDS;
  private worker: Worker | null = null;
  private started: Promise<Worker> | null = null;
  private readonly waiting = new Map<number, Waiting>();
  private next = 1;

  constructor(
    private readonly module: WebAssembly.Module,
    private readonly model: Uint8Array,
  ) {}

  /** Start the worker now; rejects if the host allows none, or the model cannot be loaded. */
  async start(): Promise<void> {
    await this.ready();
  }

  async ask(request: Request, signal?: AbortSignal): Promise<Reply> {
    signal?.throwIfAborted();
    const worker = await this.ready();
    signal?.throwIfAborted();
    const id = this.next++;
    return await new Promise<Reply>((resolve, reject) => {
      const abort = () => {
        if (!this.waiting.delete(id)) return;
        this.end(new DOMException("stopped", "AbortError"));
        reject(signal!.reason);
      };
      signal?.addEventListener("abort", abort, { once: true });
      const done = () => signal?.removeEventListener("abort", abort);
      this.waiting.set(id, {
        resolve: (reply) => (done(), resolve(reply)),
        reject: (reason) => (done(), reject(reason)),
      });
      worker.postMessage({ id, request });
    });
  }

  close(): void {
    this.end(new EngineError("the engine was closed", "closed"));
  }

  private ready(): Promise<Worker> {
    this.started ??= this.begin().catch((error) => {
      this.started = null;
      throw error;
    });
    return this.started;
  }

  private begin(): Promise<Worker> {
    const url = URL.createObjectURL(new Blob([WORKER_TEXT], { type: "text/javascript" }));
    return new Promise<Worker>((resolve, reject) => {
      const worker = new Worker(url);
      this.worker = worker;
      worker.onerror = (event) => {
        const error = new EngineError(`the worker failed: ${event.message || "the page allows none"}`, "worker");
        reject(error);
        this.end(error);
      };
      worker.onmessage = ({ data }: MessageEvent<FromWorker>) => {
        if ("ready" in data) resolve(worker);
        else if ("reply" in data) this.settle(data.id, (waiting) => waiting.resolve(readReply(data.reply)));
        else if (data.id === 0) reject(new EngineError(data.error, data.code));
        else this.settle(data.id, (waiting) => waiting.reject(new EngineError(data.error, data.code)));
      };
      worker.postMessage({ module: this.module, model: this.model });
    }).finally(() => URL.revokeObjectURL(url));
  }

  private settle(id: number, how: (waiting: Waiting) => void): void {
    const waiting = this.waiting.get(id);
    if (!waiting) return;
    this.waiting.delete(id);
    try {
      how(waiting);
    } catch (error) {
      waiting.reject(error); // a failure that the reply reports
    }
  }

  private end(reason: unknown): void {
    this.worker?.terminate();
    this.worker = null;
    this.started = null;
    const left = [...this.waiting.values()];
    this.waiting.clear();
    for (const waiting of left) waiting.reject(reason);
  }
}

/** The number of workers for work in parts: one processor is left to the page. */
export function countWorkers(processors: number | undefined): number {
  return Math.max(1, Math.min(MOST_WORKERS, (processors ?? 2) - 1));
}

/**
 * Ask for many parts, as many at a time as there are engines; `take` receives each reply as it comes. After a
 * failure no further part is asked for.
 */
export async function askAll(
  engines: readonly Engine[],
  requests: Iterable<Request>,
  take: (reply: Reply, request: Request) => void,
  signal?: AbortSignal,
): Promise<void> {
  const source = requests[Symbol.iterator]();
  let hasFailed = false;
  const work = async (engine: Engine) => {
    try {
      for (let next = source.next(); !next.done && !hasFailed; next = source.next()) {
        const reply = await engine.ask(next.value, signal);
        signal?.throwIfAborted();
        take(reply, next.value);
        await new Promise((go) => setTimeout(go)); // an engine in the page's own thread leaves time to draw
      }
    } catch (error) {
      hasFailed = true;
      throw error;
    }
  };
  await Promise.all(engines.map(work));
}

/** An engine for the pictures that follow the sliders, and engines for work in many parts. */
export interface Engines {
  readonly quick: Engine;
  /** The kernel, for what only it can do. */
  readonly kernel: Engine | null;
  many(): readonly Engine[];
  close(): void;
}

/** Engines in workers, or in the page where the host allows no workers. */
export async function makeEngines(
  module: WebAssembly.Module,
  model: Uint8Array,
  kernel: Engine | null = null,
): Promise<Engines> {
  const quick = new WorkerEngine(module, model);
  try {
    await quick.start();
  } catch (error) {
    if (error instanceof EngineError && error.code !== "worker") throw error; // the model, not the worker
    return single(await WasmEngine.create(module, model), kernel);
  }
  let pool: WorkerEngine[] = [];
  return {
    quick,
    kernel,
    many() {
      if (pool.length === 0) {
        const count = countWorkers(navigator.hardwareConcurrency);
        pool = Array.from({ length: count }, () => new WorkerEngine(module, model));
      }
      return pool;
    },
    close() {
      for (const engine of [quick, ...pool]) engine.close();
      kernel?.close();
    },
  };
}

/** One engine for all work: that of the kernel, or of a page without workers. */
export function single(engine: Engine, kernel: Engine | null = null): Engines {
  const close = () => {
    engine.close();
    kernel?.close();
  };
  return { quick: engine, kernel, many: () => [engine], close };
}

/** The engine that answers a kind of request; `null` if there is none. */
export function engineFor({ quick, kernel }: Engines, kind: string): Engine | null {
  if (quick.kinds.has(kind)) return quick;
  return kernel?.kinds.has(kind) ? kernel : null;
}
