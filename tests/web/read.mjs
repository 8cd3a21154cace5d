// Has the module that reads texts read them: node read.mjs MODULE FOLDER. The reply to every NAME.py is written to NAME.reply.
import fs from "node:fs";
import path from "node:path";

const [modulePath, folder] = process.argv.slice(2);
const module = new WebAssembly.Module(fs.readFileSync(modulePath));
const imports = WebAssembly.Module.imports(module);
if (imports.length > 0) throw new Error(`the module imports ${JSON.stringify(imports)}`);
const { exports: reader } = new WebAssembly.Instance(module, {});
const expected = ["alloc", "ask", "drop_model", "free", "free_reply", "last_error", "load", "memory", "read"];
const missing = expected.filter((name) => !(name in reader));
if (missing.length > 0) throw new Error(`the module lacks ${missing}`);

for (const file of fs.readdirSync(folder).filter((name) => name.endsWith(".py"))) {
  const bytes = fs.readFileSync(path.join(folder, file));
  const at = reader.alloc(bytes.length);
  new Uint8Array(reader.memory.buffer, at, bytes.length).set(bytes);
  const block = reader.read(at, bytes.length);
  reader.free(at, bytes.length);
  const length = new DataView(reader.memory.buffer).getUint32(block, true);
  const reply = Buffer.from(new Uint8Array(reader.memory.buffer, block + 8, length));
  reader.free_reply(block);
  fs.writeFileSync(path.join(folder, file.replace(/\.py$/, ".reply")), reply);
}
