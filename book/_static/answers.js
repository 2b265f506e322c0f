// Exercises that are answered on the page: an editor, and the course's own check in a worker (python/worker.js).
(() => {
  const PATIENCE = 10_000; // ms until a running answer is suspected of an endless loop
  const base = new URL(".", document.currentScript.src);
  const boxes = [...document.querySelectorAll(".answer[data-check]")];
  const literal = JSON.stringify; // a JSON string is a Python string
  let worker = null, current = null, asked = 0;

  // --- what the reader wrote stays in the reader's own browser; a browser may forbid that -------------------------
  const keep = (key, text) => { try { text === null ? localStorage.removeItem(key) : localStorage.setItem(key, text); } catch { /* then it lasts as long as the page */ } };
  const kept = (key) => { try { return localStorage.getItem(key); } catch { return null; } };

  // --- one check at a time -----------------------------------------------------------------------------------------
  const hire = () => {
    const hired = new Worker(new URL("python/worker.js", base), { type: "module" });
    hired.onmessage = ({ data }) => {
      if (data.say) {
        current?.say(data.say);
        if (data.say.startsWith("Checking")) current?.wait();
      } else if (current?.id === data.id) {
        if (data.error) dismiss();
        current.done(data);
      }
    };
    hired.onerror = (event) => {
      event.preventDefault();
      dismiss();
      current?.done({ error: event.message || "the worker could not be loaded" });
    };
    return hired;
  };
  const dismiss = () => { worker?.terminate(); worker = null; };
  const begin = (check) => {
    worker ??= hire();
    current = check;
    boxes.forEach((box) => { box.querySelector(".answer-check").disabled = true; });
    worker.postMessage({ id: check.id, call: check.call });
  };
  const end = () => {
    current = null;
    boxes.forEach((box) => { box.querySelector(".answer-check").disabled = false; });
  };

  // --- an editor out of a text area ----------------------------------------------------------------------------------
  const insert = (area, text) => { // so that the browser can undo it
    if (!document.execCommand("insertText", false, text)) area.setRangeText(text, area.selectionStart, area.selectionEnd, "end");
  };
  const indent = (area, out) => {
    const { selectionStart: from, selectionEnd: to, value } = area;
    if (from === to && !out) return insert(area, " ".repeat(4 - (from - value.lastIndexOf("\n", from - 1) - 1) % 4));
    const first = value.lastIndexOf("\n", from - 1) + 1;
    const lines = value.slice(first, to).split("\n");
    const moved = lines.map((line) => (out ? line.replace(/^ {1,4}/, "") : line && `    ${line}`)).join("\n");
    area.setSelectionRange(first, to);
    insert(area, moved);
    const shift = Math.max(first, from + (out ? -(lines[0].length - lines[0].replace(/^ {1,4}/, "").length) : 4));
    area.setSelectionRange(from === to ? shift : first, from === to ? shift : first + moved.length);
  };
  const newline = (area) => {
    const before = area.value.slice(area.value.lastIndexOf("\n", area.selectionStart - 1) + 1, area.selectionStart);
    insert(area, `\n${before.match(/^ */)[0]}${/:\s*(#.*)?$/.test(before) ? "    " : ""}`);
  };

  boxes.forEach((box) => {
    const part = (name) => box.querySelector(`.answer-${name}`);
    const area = box.querySelector("textarea");
    const { check: name, function: wanted, imports } = box.dataset;
    const key = `answer-${name}`, stub = area.defaultValue;
    let leaving = false, dropped = null, overdue = 0;

    const fit = () => { area.rows = Math.max(4, area.value.split("\n").length + 1); };
    const show = (place, text) => { place.textContent = text; place.hidden = !text; };
    const changed = () => {
      fit();
      keep(key, area.value === stub ? null : area.value);
      part("reset").textContent = "Reset";
      part("reset").disabled = area.value === stub;
      dropped = null;
    };
    const judge = () => {
      if (current) return;
      show(part("verdict"), "");
      show(part("printed"), "");
      part("stop").hidden = false;
      const id = ++asked;
      const settle = (state) => {
        clearTimeout(overdue);
        part("stop").hidden = true;
        part("state").textContent = state;
        end();
      };
      begin({
        id,
        call: `on_page.judge(${[name, wanted, area.value, imports].map(literal).join(", ")})`,
        say: (words) => { part("state").textContent = words; },
        wait: () => {
          overdue = setTimeout(() => {
            part("state").textContent = "Not finished after 10 s. Is there a loop whose condition never becomes false? Stop ends it.";
          }, PATIENCE);
        },
        done: ({ text, error }) => {
          settle("");
          if (error) return show(part("verdict"), `Python did not run here (${error}). Open the lab in JupyterLab instead.`);
          const { passed, hint, printed } = JSON.parse(text);
          box.dataset.verdict = passed ? "right" : "wrong";
          show(part("verdict"), passed ? "✓ Correct" : `✗ Not yet. ${hint}`);
          show(part("printed"), printed);
        },
        stop: () => {
          dismiss();
          settle("Stopped. The next check starts Python again.");
        },
      });
      part("state").textContent = "Loading …";
    };

    part("check").addEventListener("click", judge);
    part("stop").addEventListener("click", () => { current?.stop(); part("check").focus(); });
    part("reset").addEventListener("click", () => {
      const back = dropped, before = area.value;
      area.value = back ?? stub;
      changed();
      if (back === null) {
        dropped = before;
        part("reset").textContent = "Bring mine back";
        part("reset").disabled = false;
      }
      show(part("verdict"), "");
      show(part("printed"), "");
    });
    area.addEventListener("input", changed);
    area.addEventListener("blur", () => { leaving = false; });
    area.addEventListener("keydown", (event) => {
      if (event.key === "Escape") { leaving = true; return; }
      if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) judge();
      else if (event.key === "Tab" && !leaving && !event.ctrlKey && !event.altKey) indent(area, event.shiftKey);
      else if (event.key === "Enter" && !event.shiftKey && !event.isComposing) newline(area);
      else { if (event.key !== "Shift") leaving = false; return; }
      event.preventDefault();
    });

    area.value = kept(key) ?? stub; // not what the browser's form memory put there
    changed();
    if (location.protocol !== "file:") part("editor").hidden = false; // a page on disk may not start workers
  });
})();
