// Python for the exercises of a page, in a thread of its own.  The page sends {id, call}, a Python expression whose value
// is text, and hears {say} while Python starts, then {id, text} or {id, error}.
// Which Python that is, only engine.js knows: load(say) → run(expression) → text.
let engine = null;

self.onmessage = async ({ data: { id, call } }) => {
  const say = (words) => self.postMessage({ say: words });
  try {
    engine ??= import("./engine.js").then(({ load }) => load(say));
    const run = await engine;
    say("Checking …");
    self.postMessage({ id, text: run(call) });
  } catch (error) {
    self.postMessage({ id, error: String(error) });
  }
};
