/** The engine answers requests about one model. Three of them: in the page, in workers, in the kernel. */

import { EngineError, readReply, type Reply } from "./wire.ts";

export type Request = { readonly kind: string } & Readonly<Record<string, unknown>>;

export interface Engine {
  /** Answer a request; rejects with an `EngineError`, or with an `AbortError` once `signal` is aborted. */
  ask(request: Request, signal?: AbortSignal): Promise<Reply>;
  /** The requests that this engine answers. */
  readonly kinds: ReadonlySet<string>;
  close(): void;
}

/** What the Rust crate answers in WebAssembly. */
export const WASM_KINDS: ReadonlySet<string> = new Set([
  "describe",
  "run",
  "section",
  "diagram",
  "portrait",
  "ends",
  "basins",
  "sample",
]);

const BLOCK_HEAD = 8;

interface Exports {
  readonly memory: WebAssembly.Memory;
  alloc(length: number): number;
  free(pointer: number, length: number): void;
  load(pointer: number, length: number): number;
  last_error(): number;
  drop_model(handle: number): void;
  ask(handle: number, pointer: number, length: number): number;
  free_reply(pointer: number): void;
}

/** The C ABI of the module: bytes in, bytes out. A module that trapped is not used again. */
export class Module {
  private trapped: string | null = null;

  private constructor(private readonly exports: Exports) {}

  static async instantiate(module: WebAssembly.Module): Promise<Module> {
    const instance = await WebAssembly.instantiate(module, {});
    return new Module(instance.exports as unknown as Exports);
  }

  /** Load a model and return its handle. */
  load(model: Uint8Array): number {
    return this.guarded(() => {
      const handle = this.lend(model, (pointer) => this.exports.load(pointer, model.length));
      if (handle === 0) throw new EngineError(new TextDecoder().decode(this.take(this.exports.last_error())), "model");
      return handle;
    });
  }

  drop(handle: number): void {
    if (this.trapped === null) this.exports.drop_model(handle);
  }

  /** The reply to a request, as bytes of its own. */
  ask(handle: number, request: Uint8Array): Uint8Array {
    return this.guarded(() => {
      return this.take(this.lend(request, (given) => this.exports.ask(handle, given, request.length)));
    });
  }

  private guarded<T>(call: () => T): T {
    if (this.trapped !== null) throw new EngineError(this.trapped, "trap");
    try {
      return call();
    } catch (error) {
      if (error instanceof EngineError) throw error;
      this.trapped = `The engine stopped in the middle of a computation (${(error as Error).message}). Reload the page.`;
      throw new EngineError(this.trapped, "trap");
    }
  }

  private lend(given: Uint8Array, use: (pointer: number) => number): number {
    const pointer = this.exports.alloc(given.length);
    new Uint8Array(this.exports.memory.buffer, pointer, given.length).set(given);
    const result = use(pointer);
    this.exports.free(pointer, given.length);
    return result;
  }

  /** Copy a block of the module, and free it: its length, 4 bytes of zero, then so many bytes. */
  private take(pointer: number): Uint8Array {
    const length = new DataView(this.exports.memory.buffer).getUint32(pointer, true);
    const block = new Uint8Array(this.exports.memory.buffer, pointer + BLOCK_HEAD, length).slice();
    this.exports.free_reply(pointer);
    return block;
  }
}

/** The engine in the thread that asks: used inside of workers, and where a host allows no worker. */
export class WasmEngine implements Engine {
  readonly kinds = WASM_KINDS;

  private constructor(
    private readonly module: Module,
    private readonly handle: number,
  ) {}

  static async create(module: WebAssembly.Module, model: Uint8Array): Promise<WasmEngine> {
    const instance = await Module.instantiate(module);
    return new WasmEngine(instance, instance.load(model));
  }

  /** The reply as bytes; what a worker posts. */
  answer(request: Request): Uint8Array {
    return this.module.ask(this.handle, new TextEncoder().encode(JSON.stringify(request)));
  }

  async ask(request: Request, signal?: AbortSignal): Promise<Reply> {
    signal?.throwIfAborted();
    return readReply(this.answer(request));
  }

  close(): void {
    this.module.drop(this.handle);
  }
}
