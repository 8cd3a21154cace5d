/**
 * Replies of the engine: a header of JSON, then arrays of 64-bit floats.
 *
 * Layout: 4 bytes little-endian length of the header, the header, zeros up to a multiple of 8, the arrays.
 */

/** An array of a reply: `shape` rows and columns over `data`. */
export interface Table {
  readonly data: Float64Array;
  readonly shape: readonly number[];
}

export type Header = { readonly ok: boolean; readonly kind?: string } & Record<string, unknown>;

/** What the engine could not do, in its own words. */
export class EngineError extends Error {
  constructor(
    message: string,
    readonly code: string = "",
  ) {
    super(message);
    this.name = "EngineError";
  }
}

export class Reply {
  constructor(
    readonly header: Header,
    private readonly tables: ReadonlyMap<string, Table>,
  ) {}

  /** The array of that name; an array that is missing is a fault of the engine, and is named. */
  table(name: string): Table {
    const found = this.tables.get(name);
    if (!found) throw new EngineError(`the reply "${this.header.kind}" has no array "${name}"`, "reply");
    return found;
  }

  has(name: string): boolean {
    return this.tables.has(name);
  }
}

/** Read a reply. A failure that the engine reports, and bytes that are no reply, are an `EngineError`. */
export function readReply(bytes: Uint8Array): Reply {
  if (bytes.byteLength < 4) throw new EngineError("the engine returned no reply", "reply");
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const length = view.getUint32(0, true);
  const start = alignedTo8(4 + length);
  if (4 + length > bytes.byteLength) throw new EngineError("the reply of the engine is cut off", "reply");
  let header: Header;
  try {
    header = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + length))) as Header;
  } catch {
    throw new EngineError("the header of the reply is no JSON", "reply");
  }
  if (!header.ok) throw new EngineError(String(header.error ?? "the engine failed"), String(header.code ?? ""));
  return new Reply(header, readTables(header, bytes, Math.min(start, bytes.byteLength)));
}

/** Make the bytes of a reply; what tests and other engines need. */
export function packReply(header: Header, tables: Readonly<Record<string, Table>> = {}): Uint8Array {
  const places: Record<string, [number, readonly number[]]> = {};
  let count = 0;
  for (const [name, table] of Object.entries(tables)) {
    places[name] = [count, table.shape];
    count += table.data.length;
  }
  const text = new TextEncoder().encode(JSON.stringify({ ...header, arrays: places }));
  const start = alignedTo8(4 + text.length);
  const bytes = new Uint8Array(start + 8 * count);
  const view = new DataView(bytes.buffer);
  view.setUint32(0, text.length, true);
  bytes.set(text, 4);
  let place = start;
  for (const { data } of Object.values(tables)) {
    for (const value of data) {
      view.setFloat64(place, value, true);
      place += 8;
    }
  }
  return bytes;
}

function readTables(header: Header, bytes: Uint8Array, start: number): Map<string, Table> {
  const places = (header.arrays ?? {}) as Record<string, [number, number[]]>;
  const body = bytes.slice(start); // a copy is aligned, wherever the reply stood
  const values = new Float64Array(body.buffer, 0, Math.floor(body.byteLength / 8));
  const tables = new Map<string, Table>();
  for (const [name, [offset, shape]] of Object.entries(places)) {
    const size = shape.reduce((product, side) => product * side, 1);
    if (offset + size > values.length) throw new EngineError(`the array "${name}" of the reply is cut off`, "reply");
    tables.set(name, { data: values.subarray(offset, offset + size), shape });
  }
  return tables;
}

function alignedTo8(length: number): number {
  return Math.ceil(length / 8) * 8;
}
