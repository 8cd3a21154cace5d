/** Made-up replies and models, for tests only. */

import type { Description } from "../src/model.ts";
import { toDescription } from "../src/model.ts";
import type { Run } from "../src/replies.ts";
import { toRun } from "../src/replies.ts";
import { packReply, readReply, type Header, type Table } from "../src/wire.ts";

export function table(rows: readonly (readonly number[])[]): Table {
  return { data: Float64Array.from(rows.flat()), shape: [rows.length, rows[0]?.length ?? 0] };
}

export function column(values: readonly number[]): Table {
  return { data: Float64Array.from(values), shape: [values.length] };
}

export const FRICTION: Header = {
  ok: true,
  kind: "describe",
  n: 2,
  states: ["y", "v"],
  params: [
    { name: "F", value: 0.4 },
    { name: "omega", value: 2 },
  ],
  surfaces: ["v"],
  page: { title: "dry friction", y0: [1, 2], t_span: [0, 20], axes: null, text: null, reference: "dry_friction" },
};

export function friction(): Description {
  return toDescription(FRICTION);
}

/** A run that falls, sticks for 3 of 5 units of time, and jumps before its last piece. */
export function stickingRun(): Run {
  const header: Header = {
    ok: true,
    kind: "run",
    status: "finished",
    success: true,
    message: "reached the end",
    steps: 4,
    nfev: 9,
    warnings: [],
    pieces: [
      { mode: "+", first: 0, last: 2, kind: "region" },
      { mode: "0", first: 3, last: 4, kind: "sliding" },
      { mode: "-", first: 5, last: 6, kind: "region" },
    ],
    switches: [
      { t: 1, kind: "enter_sliding", surfaces: ["v"], from: "+", to: "0", y: [2, 0] },
      { t: 4, kind: "exit_sliding", surfaces: ["v"], from: "0", to: "-", y: [2, 0] },
    ],
  };
  const t = column([0, 0.5, 1, 1, 4, 4, 5]);
  const y = table([
    [1, 2],
    [1.6, 1],
    [2, 0],
    [2, 0],
    [2, 0],
    [1.5, 0],
    [1, -1],
  ]);
  return toRun(readReply(packReply(header, { t, y })));
}
