/** The thread of a worker: one module, one model, one request after the other. */

import { WasmEngine, type Request } from "./engine.ts";

export type ToWorker =
  | { readonly module: WebAssembly.Module; readonly model: Uint8Array }
  | { readonly id: number; readonly request: Request };

export type FromWorker =
  | { readonly ready: true }
  | { readonly id: number; readonly reply: Uint8Array }
  | { readonly id: number; readonly error: string; readonly code: string };

interface Scope {
  onmessage: ((event: MessageEvent<ToWorker>) => void) | null;
  postMessage(message: FromWorker, transfer?: Transferable[]): void;
}

const scope = self as unknown as Scope;
const NO_REQUEST = 0;
let engine: WasmEngine | null = null;

scope.onmessage = ({ data }) => {
  if ("module" in data) {
    WasmEngine.create(data.module, data.model).then(
      (made) => {
        engine = made;
        scope.postMessage({ ready: true });
      },
      (error) => fail(NO_REQUEST, error),
    );
    return;
  }
  try {
    if (engine === null) throw new Error("the worker has no model yet");
    const reply = engine.answer(data.request);
    scope.postMessage({ id: data.id, reply }, [reply.buffer as ArrayBuffer]);
  } catch (error) {
    fail(data.id, error);
  }
};

function fail(id: number, error: unknown): void {
  const { message, code } = error as { message?: string; code?: string };
  scope.postMessage({ id, error: message ?? String(error), code: code ?? "" });
}
