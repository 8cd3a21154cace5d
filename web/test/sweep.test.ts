import assert from "node:assert/strict";
import { test } from "node:test";
import type { Engine } from "../src/engine.ts";
import { Job } from "../src/job.ts";
import { Latest } from "../src/latest.ts";
import { askAll, countWorkers } from "../src/pool.ts";
import { chunks, coarseToFine, evenly } from "../src/sweep.ts";
import { Reply } from "../src/wire.ts";

test("coarse to fine has every value once, the ends of the interval early", () => {
  const values = evenly([0, 1], 480);
  const order = coarseToFine(values);
  assert.deepEqual(
    [...order].sort((a, b) => a - b),
    values,
  );
  const gap = Math.max(
    ...order
      .slice(0, 30)
      .sort((a, b) => a - b)
      .map((v, k, all) => v - (all[k - 1] ?? 0)),
  );
  assert.ok(gap < 17 / 479 + 1e-9, `after 30 values the widest gap is ${gap}`);
});

test("parts are whole", () => {
  assert.deepEqual(chunks([1, 2, 3, 4, 5], 2), [[1, 2], [3, 4], [5]]);
  assert.deepEqual(evenly([3, 4], 1), [3]);
});

test("the newest request wins: one runs, one waits, those between are dropped", async () => {
  const seen: number[] = [];
  let release: () => void = () => undefined;
  const latest = new Latest<number>(async (n) => {
    seen.push(n);
    if (n === 1) await new Promise<void>((resolve) => (release = resolve));
  });
  for (const n of [1, 2, 3, 4]) latest.ask(n);
  assert.deepEqual(seen, [1]);
  release();
  await latest.settled();
  assert.deepEqual(seen, [1, 4]);
});

test("a request without content is a request", async () => {
  let calls = 0;
  const latest = new Latest<null>(async () => void calls++);
  latest.ask(null);
  await latest.settled();
  assert.equal(calls, 1);
});

test("work that is started again stops what runs; of several starts only the last works", async () => {
  const job = new Job();
  const log: string[] = [];
  const work = (name: string) => async (signal: AbortSignal) => {
    log.push(name);
    if (name === "a") await new Promise((resolve) => signal.addEventListener("abort", resolve));
  };
  void job.start(work("a"));
  await Promise.resolve();
  void job.start(work("b"));
  await job.start(work("c"));
  assert.deepEqual(log, ["a", "c"]);
  assert.ok(!job.isRunning);
});

function engine(work: () => Promise<Reply>): Engine {
  return { kinds: new Set(), ask: work, close: () => undefined };
}

test("all parts are asked for, as many at a time as there are engines", async () => {
  let [now, most] = [0, 0];
  const made = Array.from({ length: 3 }, () =>
    engine(async () => {
      most = Math.max(most, ++now);
      await new Promise((resolve) => setTimeout(resolve, 1));
      now--;
      return new Reply({ ok: true }, new Map());
    }),
  );
  let taken = 0;
  const requests = Array.from({ length: 20 }, (_, k) => ({ kind: "diagram", k }));
  await askAll(made, requests, () => taken++);
  assert.equal(taken, 20);
  assert.equal(most, 3);
});

test("after a failure no further part is asked for", async () => {
  let asked = 0;
  const failing = engine(async () => {
    asked++;
    throw new Error("no");
  });
  await assert.rejects(
    askAll(
      [failing, failing],
      Array.from({ length: 50 }, () => ({ kind: "diagram" })),
      () => undefined,
    ),
    /no/,
  );
  assert.ok(asked <= 2, `${asked} were asked for`);
});

test("one processor is left to the page", () => {
  assert.deepEqual([undefined, 1, 2, 4, 64].map(countWorkers), [1, 1, 1, 3, 8]);
});
