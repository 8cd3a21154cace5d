import assert from "node:assert/strict";
import { test } from "node:test";
import { CommEngine, HttpEngine, type Comm } from "../src/engine.remote.ts";
import { engineFor, single } from "../src/pool.ts";
import { packReply } from "../src/wire.ts";
import { column } from "./made_up.ts";

type Callback = (content: unknown, buffers: DataView[]) => void;

/** A kernel that answers as it is told. */
class FakeComm implements Comm {
  readonly sent: { kind: string; id: number; request: unknown }[] = [];
  private readonly callbacks = new Set<Callback>();

  send(content: unknown): void {
    this.sent.push(content as FakeComm["sent"][number]);
  }

  on(_: "msg:custom", callback: Callback): void {
    this.callbacks.add(callback);
  }

  off(_: "msg:custom", callback: Callback): void {
    this.callbacks.delete(callback);
  }

  answer(id: number, reply: Uint8Array | null, error?: string): void {
    const buffers = reply ? [new DataView(reply.buffer)] : [];
    for (const callback of this.callbacks) callback({ kind: "reply", id, ...(error ? { error } : {}) }, buffers);
  }

  get listeners(): number {
    return this.callbacks.size;
  }
}

test("answers of the kernel reach who asked, in any order", async () => {
  const comm = new FakeComm();
  const engine = new CommEngine(comm, new Set(["run"]));
  const [first, second] = [engine.ask({ kind: "run", n: 1 }), engine.ask({ kind: "run", n: 2 })];
  comm.answer(comm.sent[1].id, packReply({ ok: true }, { t: column([2]) }));
  comm.answer(comm.sent[0].id, packReply({ ok: true }, { t: column([1]) }));
  comm.answer(99, packReply({ ok: true })); // of another widget
  assert.equal((await first).table("t").data[0], 1);
  assert.equal((await second).table("t").data[0], 2);
});

test("failures of the kernel, a stop and the end are told apart", async () => {
  const comm = new FakeComm();
  const engine = new CommEngine(comm, new Set(["run"]));
  const wrong = engine.ask({ kind: "run" });
  comm.answer(comm.sent[0].id, null, "the kernel is busy");
  await assert.rejects(wrong, /the kernel is busy/);
  const refused = engine.ask({ kind: "run" });
  comm.answer(comm.sent[1].id, packReply({ ok: false, error: "y0: 2 values are needed" }));
  await assert.rejects(refused, /y0: 2 values/);
  const stopper = new AbortController();
  const stopped = engine.ask({ kind: "run" }, stopper.signal);
  stopper.abort(new DOMException("stopped", "AbortError"));
  await assert.rejects(stopped, (error: Error) => error.name === "AbortError");
  const left = engine.ask({ kind: "run" });
  engine.close();
  await assert.rejects(left, /closed/);
  assert.equal(comm.listeners, 0);
});

test("the local server is asked with its token, and its refusal is told in its words", async () => {
  const before = globalThis.fetch;
  const asked: { url: string; init: RequestInit }[] = [];
  try {
    globalThis.fetch = (async (url: string, init: RequestInit) => {
      asked.push({ url, init });
      return asked.length === 1
        ? new Response(packReply({ ok: true, kind: "run" }) as Uint8Array<ArrayBuffer>)
        : new Response("The token is missing or wrong.", { status: 403 });
    }) as typeof fetch;
    const engine = new HttpEngine("ask", "secret", new Set(["run"]));
    assert.equal((await engine.ask({ kind: "run", F: 1 })).header.kind, "run");
    assert.equal((asked[0].init.headers as Record<string, string>)["X-Filippov-Token"], "secret");
    assert.deepEqual(JSON.parse(String(asked[0].init.body)), { kind: "run", F: 1 });
    await assert.rejects(engine.ask({ kind: "run" }), /The token is missing or wrong/);
    globalThis.fetch = (async () => {
      throw new TypeError("failed");
    }) as typeof fetch;
    await assert.rejects(engine.ask({ kind: "run" }), /does not answer/);
  } finally {
    globalThis.fetch = before;
  }
});

test("what only the kernel answers is asked of the kernel, and of nobody where there is none", () => {
  const page = new CommEngine(new FakeComm(), new Set(["run"]));
  const kernel = new CommEngine(new FakeComm(), new Set(["run", "cycle"]));
  assert.equal(engineFor(single(page, kernel), "run"), page);
  assert.equal(engineFor(single(page, kernel), "cycle"), kernel);
  assert.equal(engineFor(single(page), "cycle"), null);
});
