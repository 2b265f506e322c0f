// The test bed's engine: load(say) → run(expression) → text, by CPython 3.11 and NumPy 1.24 of the package python-wasm.
import { told } from "./globals.mjs";
import cowasm from "@cowasm/kernel/dist/wasm/worker/browser.js";

const here = new URL(".", import.meta.url).href;
const LIBRARY = "/usr/lib/python3.11";
const PYTHON = "/usr/lib/python.wasm";

export async function load(say) {
  say("Starting Python (once, about 5 s) …");
  self.onmessage = told;
  const kernel = await cowasm.default(`${here}kernel.wasm`, {
    env: { PYTHONHOME: "/usr", PYTHONEXECUTABLE: PYTHON },
    fs: [{ type: "zipurl", zipurl: `${here}python-stdlib.zip`, mountpoint: LIBRARY }, { type: "dev" }],
    wasmEnv: { wasmGetSignalState: () => 0 },
    sendStderr: (text) => console.info(new TextDecoder().decode(text)),
  });
  kernel.callWithString("chdir", "/");
  await Promise.all(Object.entries({
    "python.wasm": PYTHON,
    "numpy.tar.xz": `${LIBRARY}/numpy.tar.xz`,
    "checks.zip": "/checks.zip",
  }).map(async ([name, path]) => {
    const answer = await fetch(`${here}${name}`);
    kernel.fs.writeFileSync(path, new Uint8Array(await answer.arrayBuffer()));
  }));
  const call = (name, text) => kernel.callWithString({ name, dll: PYTHON }, text);
  call("cowasm_python_init");
  call("cowasm_python_exec", "import sys; sys.path.insert(0, '/checks.zip'); from coursekit.teaching import on_page");
  // It gives the value's repr; hexadecimal digits need no unquoting.
  return (expression) => {
    const digits = call("cowasm_python_repr", `(${expression}).encode().hex()`).slice(1, -1);
    return new TextDecoder().decode(Uint8Array.from(digits.match(/../g), (pair) => parseInt(pair, 16)));
  };
}
