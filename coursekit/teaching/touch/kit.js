// What every touched figure stands on: a drawing in metres, handles to drag or to move by arrow keys, and a sentence.
(root, size) => {
  const NS = "http://www.w3.org/2000/svg", [left, right, bottom, top] = size, px = 640 / (right - left);
  const svg = root.querySelector("svg"), said = root.querySelector(".touch-words");
  const height = (top - bottom) * px;
  svg.setAttribute("viewBox", `0 0 640 ${height.toFixed(1)}`);
  const at = ([x, y]) => [(x - left) * px, (top - y) * px];
  const below = svg.appendChild(document.createElementNS(NS, "g")), above = svg.appendChild(document.createElementNS(NS, "g")); // handles lie on top
  const make = (name, attributes, parent = below) => {
    const element = document.createElementNS(NS, name);
    Object.entries(attributes).forEach(([key, value]) => element.setAttribute(key, value));
    return parent.appendChild(element);
  };
  // A path through points in the figure's own units; `set` moves it.
  const line = (kind, closed = false) => {
    const path = make("path", { class: `touch-line ${kind}` });
    return (points) => path.setAttribute("d", points.length ? `M${points.map((p) => at(p).map((v) => v.toFixed(2)).join(",")).join("L")}${closed ? "Z" : ""}` : "");
  };
  const dot = (kind, radius = 5) => {
    const circle = make("circle", { class: `touch-dot ${kind}`, r: radius });
    const set = (p) => { const [x, y] = at(p); circle.setAttribute("cx", x); circle.setAttribute("cy", y); };
    set.radius = (wide) => circle.setAttribute("r", wide.toFixed(2));
    return set;
  };
  const text = (kind = "") => {
    const words = make("text", { class: `touch-text ${kind}` });
    return (p, what) => { const [x, y] = at(p); words.setAttribute("x", x); words.setAttribute("y", y); words.textContent = what; };
  };
  // The robot: a triangle whose tip looks ahead.
  const robot = (kind) => {
    const set = line(`touch-robot ${kind}`, true);
    return ([x, y, t], length = 0.36) => set([[1, 0], [-0.7, 0.6], [-0.4, 0], [-0.7, -0.6]].map(([a, b]) =>
      [x + length * (Math.cos(t) * a - Math.sin(t) * b) / 1.6, y + length * (Math.sin(t) * a + Math.cos(t) * b) / 1.6]));
  };
  // A handle: drag it, or focus it and use the arrow keys (with Shift, or Page Up and Down: ten times as far; Home and
  // End: to its limits).  `place` clips a wish to what is allowed, `told` says where it is, `changed` redraws.  `along`
  // names a handle's only direction: "x", "y", or "turn", round `about()`, where `step` is in radians.
  const handles = [];
  const handle = (label, start, { step = 0.05, place = (p) => p, along = "", about = null, told, changed }) => {
    let where = place(start);
    const angle = () => Math.atan2(where[1] - about()[1], where[0] - about()[0]);
    const grip = make("g", { class: "touch-handle", tabindex: 0, role: "slider", "aria-label": label, "data-lm-suppress-shortcuts": "true" }, above);
    make("circle", { class: "touch-reach", r: 22 }, grip);
    make("circle", { class: "touch-grip", r: 9 }, grip);
    const way = make("path", { class: "touch-way", d: along ? "M-13,-4L-18,0L-13,4M13,-4L18,0L13,4" : "" }, grip);
    const show = () => {
      const [x, y] = at(where);
      grip.setAttribute("transform", `translate(${x.toFixed(2)},${y.toFixed(2)})`);
      grip.setAttribute("aria-valuetext", told(where));
      way.setAttribute("transform", `rotate(${along === "y" ? 90 : along === "turn" ? 90 - angle() * 180 / Math.PI : 0})`);
    };
    const move = (wish) => { where = place(wish); show(); changed(); };
    const under = (event) => {
      const box = svg.getBoundingClientRect(), scale = 640 / box.width;
      return [left + (event.clientX - box.left) * scale / px, top - (event.clientY - box.top) * scale / px];
    };
    handles.push({ grip, take: (event) => {
      event.preventDefault(); grip.focus(); grip.setPointerCapture(event.pointerId);
      const from = under(event), off = [where[0] - from[0], where[1] - from[1]];
      const drag = (e) => { const [x, y] = under(e); move([x + off[0], y + off[1]]); };
      grip.addEventListener("pointermove", drag);
      grip.addEventListener("lostpointercapture", () => grip.removeEventListener("pointermove", drag), { once: true });
    }, far: (event) => Math.hypot(...at(where).map((v, i) => v - at(under(event))[i])) });
    grip.addEventListener("keydown", (event) => {
      if (event.altKey || event.ctrlKey || event.metaKey) return;
      const sideways = along === "x" ? 0 : 1; // what Page Up and Page Down move
      const [axis, by] = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [1, 1], ArrowDown: [1, -1], PageUp: [sideways, 10],
        PageDown: [sideways, -10], Home: [along === "y" ? 1 : 0, -1e6], End: [along === "y" ? 1 : 0, 1e6] }[event.key] ?? [];
      if (!by) return;
      event.preventDefault();
      const far = step * by * (event.shiftKey && Math.abs(by) === 1 ? 10 : 1);
      if (along !== "turn") return move(where.map((v, i) => (i === axis ? v + far : v)));
      const [x, y] = about(), left = event.key.startsWith("Arrow") && axis === 0 ? -1 : 1; // a turn to the left is positive
      const t = Math.abs(by) > 10 ? 3.14 * Math.sign(by) : angle() + left * far;
      move([x + Math.cos(t), y + Math.sin(t)]);
    });
    show();
    return { get at() { return where; }, set at(p) { where = place(p); show(); } };
  };
  // Where the reaches of two handles meet, the nearer one is taken.
  above.addEventListener("pointerdown", (event) => {
    handles.filter(({ grip }) => grip.style.display !== "none").reduce((a, b) => (b.far(event) < a.far(event) ? b : a)).take(event);
  });
  // The sentence below the figure is spoken when the reader pauses, not at every pixel.
  let pause = null;
  const say = (words) => {
    root.querySelector(".touch-result").textContent = words;
    clearTimeout(pause);
    pause = setTimeout(() => { said.textContent = words; }, 700);
  };
  const button = (label, pressed) => {
    const element = document.createElement("button");
    element.type = "button"; element.textContent = label;
    element.addEventListener("click", pressed);
    root.querySelector(".touch-buttons").append(element);
    return element;
  };
  // Standard normal numbers, the same for the same seed: xorshift, then Box and Muller.
  const normals = (seed, n) => {
    let state = (seed * 2654435761) >>> 0 || 1;
    const uniform = () => { state ^= state << 13; state >>>= 0; state ^= state >>> 17; state ^= state << 5; state >>>= 0; return (state + 0.5) / 4294967296; };
    for (let i = 0; i < 20; i++) uniform();
    return Array.from({ length: n }, () => Math.sqrt(-2 * Math.log(uniform())) * Math.cos(2 * Math.PI * uniform()));
  };
  const clip = (v, low, high) => Math.min(Math.max(v, low), high);
  return { svg, make, at, px, line, dot, text, robot, handle, say, button, clip, normals, quiet: matchMedia("(prefers-reduced-motion: reduce)").matches };
}
