export default {
  render({ model, el }) {
    // Each press changes the command a little, and the robot keeps it.  While it moves, the pad asks for one picture
    // a tenth of a second, and never for the next before the last has come.
    const [step, most, turn, twist] = model.get("speeds");
    el.innerHTML = `<div class="pad" data-lm-suppress-shortcuts="true" tabindex="0" role="group"
        aria-label="Drive the robot: arrow keys or W A S D, space bar to stop">
      <img alt=""><p class="pad-says" role="status"></p><div class="pad-keys">
      <button data-do="left">◀ left</button><button data-do="faster">▲ faster</button>
      <button data-do="slower">▼ slower, back</button><button data-do="right">right ▶</button>
      <button data-do="stop">Stop</button><button data-do="reset">Back to the start</button></div></div>`;
    const pad = el.querySelector(".pad"), image = el.querySelector("img"), says = el.querySelector(".pad-says");
    const keys = { ArrowUp: "faster", w: "faster", ArrowDown: "slower", s: "slower", ArrowLeft: "left", a: "left",
                   ArrowRight: "right", d: "right", " ": "stop" };
    const clip = (value, limit) => Math.round(100 * Math.min(Math.max(value, -limit), limit)) / 100;
    let v = 0, omega = 0, busy = false, queued = null, address = null, moves = false;

    const ask = (question) => {
      if (busy) { queued = question; return; }
      busy = true;
      model.send(question);
    };
    model.on("msg:custom", (said, [picture]) => {
      if (!el.isConnected) return;
      busy = false;
      moves = said.moves;
      if (address) URL.revokeObjectURL(address);
      address = URL.createObjectURL(new Blob([picture], { type: "image/png" }));
      image.src = address;
      image.alt = said.alt;
      const next = queued;
      queued = null;
      if (next) ask(next);
    });
    const timer = setInterval(() => { if ((v || omega || moves) && !busy) ask({ drive: [v, omega] }); }, 100);

    const act = {
      faster: () => { v = clip(v + step, most); },
      slower: () => { v = clip(v - step, most); },
      left: () => { omega = clip(omega + turn, twist); },
      right: () => { omega = clip(omega - turn, twist); },
      stop: () => { v = omega = 0; },
      reset: () => { v = omega = 0; ask({ reset: true }); },
    };
    const press = (what) => {
      act[what]();
      says.textContent = `Command: ${v.toFixed(1)} m/s, ${omega.toFixed(1)} rad/s`;
    };
    el.addEventListener("click", (event) => {
      const what = event.target.dataset?.do;
      if (what) press(what); else pad.focus();
    });
    pad.addEventListener("keydown", (event) => {
      if (event.target !== pad && event.key === " ") return; // the space bar presses the button that has the focus
      const what = keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
      if (!what || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      event.stopPropagation(); // JupyterLab has meanings of its own for letters and arrows
      press(what);
    });
    says.textContent = "Click the picture, then drive with the arrow keys or W A S D; the space bar stops. Drive into a wall, and keep going.";
    ask({});
    return () => clearInterval(timer);
  },
};
