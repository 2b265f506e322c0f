(root) => {
  // One explorer of the static book: turn the controls' positions into a frame number and show that frame.
  const data = JSON.parse(root.querySelector(".explorer-data").textContent);
  const image = root.querySelector("img"), words = root.querySelector(".explorer-words");
  const controls = [...root.querySelectorAll(".explorer-control")];
  const range = (c) => c.querySelector("input[type=range]");
  const position = (c) => Number((range(c) ?? c.querySelector("input:checked")).value);
  const frame = (positions) => positions.reduce((k, p, i) => k * data.sizes[i] + p, 0);
  const loaded = new Map();
  const load = (k) => {
    if (!loaded.has(k)) { const ahead = new Image(); ahead.src = data.frames[k]; loaded.set(k, ahead); }
  };
  const neighbours = (at) => at.forEach((p, i) => [p - 1, p + 1].forEach((q) => {
    if (q >= 0 && q < data.sizes[i]) load(frame(at.with ? at.with(i, q) : at.map((v, j) => (j === i ? q : v))));
  }));
  const show = () => {
    const at = controls.map(position), k = frame(at);
    image.src = data.frames[k];
    image.alt = words.textContent = data.alts[k];
    controls.forEach((c, i) => {
      if (!range(c)) return;
      c.querySelector("output").textContent = data.texts[i][at[i]];
      range(c).setAttribute("aria-valuetext", data.texts[i][at[i]]);
    });
    neighbours(at);
  };
  root.addEventListener("input", show);
  root.querySelectorAll(".explorer-play").forEach((button) => {
    let timer = null;
    const input = range(button.closest(".explorer-control"));
    const stop = () => { clearInterval(timer); timer = null; button.textContent = "▶"; };
    button.addEventListener("click", () => {
      if (timer) return stop();
      if (input.value === input.max) input.value = input.min;
      button.textContent = "❚❚";
      timer = setInterval(() => { input.stepUp(); show(); if (input.value === input.max) stop(); }, 150);
    });
  });
  // Fetch the neighbours only when the reader comes near: a page loads one frame an explorer.
  new IntersectionObserver((seen, observer) => {
    if (seen.some((s) => s.isIntersecting)) { observer.disconnect(); neighbours(controls.map(position)); }
  }, { rootMargin: "200px" }).observe(root);
}
