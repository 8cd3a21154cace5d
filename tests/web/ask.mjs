// Asks the module of the page: node ask.mjs MODULE FOLDER [REPEATS].
//
// For every NAME.flp in the folder the requests NAME.*.json are asked, and each reply is written to NAME.*.reply. With REPEATS each
// request is asked so often, and the median time in milliseconds is printed.
import fs from "node:fs";
import path from "node:path";

const [modulePath, folder, repeats = "1"] = process.argv.slice(2);
const module = new WebAssembly.Module(fs.readFileSync(modulePath));
const imports = WebAssembly.Module.imports(module);
if (imports.length > 0) throw new Error(`the module imports ${JSON.stringify(imports)}`);
const { exports: engine } = new WebAssembly.Instance(module, {});

function handed(bytes, use) {
  const at = engine.alloc(bytes.length);
  new Uint8Array(engine.memory.buffer, at, bytes.length).set(bytes);
  try {
    return use(at, bytes.length);
  } finally {
    engine.free(at, bytes.length);
  }
}

function block(at) {
  const length = new DataView(engine.memory.buffer).getUint32(at, true);
  const bytes = Buffer.from(new Uint8Array(engine.memory.buffer, at + 8, length));
  engine.free_reply(at);
  return bytes;
}

for (const file of fs.readdirSync(folder).filter((name) => name.endsWith(".flp"))) {
  const name = file.slice(0, -".flp".length);
  const handle = handed(fs.readFileSync(path.join(folder, file)), engine.load);
  if (handle === 0) throw new Error(`${name}: ${block(engine.last_error())}`);
  const requests = fs.readdirSync(folder).filter((other) => other.startsWith(`${name}.`) && other.endsWith(".json"));
  for (const request of requests) {
    const bytes = fs.readFileSync(path.join(folder, request));
    const times = [];
    let reply;
    for (let k = 0; k < Number(repeats); k++) {
      const begin = performance.now();
      reply = block(handed(bytes, (at, length) => engine.ask(handle, at, length)));
      times.push(performance.now() - begin);
    }
    fs.writeFileSync(path.join(folder, request.replace(/\.json$/, ".reply")), reply);
    times.sort((a, b) => a - b);
    if (repeats !== "1") console.log(request, times[times.length >> 1].toFixed(3));
  }
  engine.drop_model(handle);
}
