// Pyodide, from this folder: tools/engine.py puts it here.
import { loadPyodide } from "./pyodide.mjs";

const here = new URL(".", import.meta.url).href;

export async function load(say) {
  say("Starting Python (once, about 5 s) …");
  const [python, checks] = await Promise.all([
    loadPyodide({ indexURL: here, packageBaseUrl: here, packages: ["numpy"] }),
    fetch(`${here}checks.zip`).then((answer) => answer.arrayBuffer()),
  ]);
  python.unpackArchive(checks, "zip", { extractDir: "/checks" });
  python.runPython("import sys; sys.path.insert(0, '/checks'); from coursekit.teaching import on_page");
  return (expression) => python.runPython(expression);
}
