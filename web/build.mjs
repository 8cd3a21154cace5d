// Builds the front: `node build.mjs` into the Python package, `node build.mjs --test` the tests into `.built/test`.
import { build } from "esbuild";
import { copyFile, mkdir, readdir } from "node:fs/promises";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));
const target = join(here, "..", "python", "filippov", "app", "static");
const common = { bundle: true, target: "es2022", format: "esm", charset: "utf8", logLevel: "warning" };

/** The worker travels as text inside of the module, so that one file is all that a host has to serve. */
async function workerText(minify) {
  const { outputFiles } = await build({
    ...common,
    entryPoints: [join(here, "src/engine.worker.ts")],
    format: "iife",
    minify,
    write: false,
  });
  return outputFiles[0].text;
}

async function page() {
  await mkdir(target, { recursive: true });
  await build({
    ...common,
    entryPoints: { app: join(here, "src/main.ts") },
    outdir: target,
    minify: true,
    loader: { ".css": "text" },
    define: { WORKER_TEXT: JSON.stringify(await workerText(true)) },
  });
  await build({ ...common, entryPoints: [join(here, "src/app.css")], outdir: target, minify: true });
  await copyFile(join(here, "src/index.html"), join(target, "index.html"));
}

async function tests() {
  const folder = join(here, "test");
  const entryPoints = (await readdir(folder))
    .filter((name) => name.endsWith(".test.ts"))
    .map((name) => join(folder, name));
  await build({
    ...common,
    entryPoints,
    outdir: join(here, ".built/test"),
    outExtension: { ".js": ".mjs" },
    platform: "node",
    sourcemap: "inline",
    loader: { ".css": "text" },
    define: { WORKER_TEXT: '""' },
  });
}

await (process.argv.includes("--test") ? tests() : page());
