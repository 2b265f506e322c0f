(root, sourceOf) => {
  // One explorer.  The positions of the controls name a picture; `source(positions)` finds it: among the page's own
  // frames (frames.js), or at the kernel (live.js).  `root.set` and `root.facts` are for the text around it.
  const part = (name) => root.querySelector(`.explorer-${name}`);
  const data = JSON.parse(part("data").textContent);
  const source = sourceOf(data, root);
  const form = part("controls"), words = part("words"), problem = part("problem"), image = root.querySelector("img");
  const controls = [...form.querySelectorAll(".explorer-control")];
  const range = (control) => control.querySelector("input[type=range]");
  const position = (control) => Number((range(control) ?? control.querySelector("input:checked")).value);
  const calm = matchMedia("(prefers-reduced-motion: reduce)");
  let stopPlaying = null, speaking = null;

  // A screen reader hears where the reader stopped, not every step of the way.
  const announce = () => {
    clearTimeout(speaking);
    if (!stopPlaying) speaking = setTimeout(() => { words.textContent = image.alt; }, 400);
  };

  const show = async () => {
    const at = controls.map(position);
    controls.forEach((control, i) => {
      if (!range(control)) return;
      control.querySelector("output").textContent = data.texts[i][at[i]];
      range(control).setAttribute("aria-valuetext", data.texts[i][at[i]]);
    });
    const picture = await source(at);
    if (!picture) return; // a newer position has been asked for
    problem.textContent = picture.error ?? "";
    if (picture.error) return;
    image.src = picture.src;
    image.alt = picture.alt;
    root.facts = picture.facts ?? {};
    root.dispatchEvent(new Event("explorer", { bubbles: true }));
    announce();
    image.classList.toggle("explorer-waiting", !image.complete);
    // The frame before is still on the screen, dimmed, until this one can be drawn.  A picture that is fetched when it
    // comes near is waited for first: Firefox never settles what `decode` promised before that.
    while (!image.complete) await new Promise((settled) => { image.onload = image.onerror = settled; });
    await image.decode().then(() => image.classList.remove("explorer-waiting"), () => {});
  };

  const move = (control, value) => {
    if (range(control)) range(control).value = value;
    else control.querySelector(`input[value="${value}"]`).checked = true;
  };
  root.at = () => controls.map(position);
  root.set = (positions) => {
    stopPlaying?.();
    controls.forEach((c) => { if (c.dataset.name in positions) move(c, positions[c.dataset.name]); });
    return show();
  };

  form.querySelectorAll(".explorer-play").forEach((button) => {
    const input = range(button.closest(".explorer-control")), label = button.dataset.label;
    const dress = (on) => {
      button.textContent = on ? "❚❚" : calm.matches ? "▶❘" : "▶";
      button.setAttribute("aria-label", `${on ? "Pause" : calm.matches ? "Next step of" : "Play"} ${label}`);
    };
    const play = () => {
      let timer = null;
      const stop = () => { clearTimeout(timer); stopPlaying = null; dress(false); announce(); };
      const tick = async () => {
        input.stepUp();
        await show();
        if (stopPlaying !== stop) return;
        if (input.value === input.max) stop(); else timer = setTimeout(tick, 150);
      };
      stopPlaying?.();
      stopPlaying = stop;
      dress(true);
      tick();
      return stop;
    };
    let mine = null;
    dress(false);
    calm.addEventListener("change", () => dress(false));
    button.addEventListener("click", () => {
      if (stopPlaying && stopPlaying === mine) return stopPlaying();
      if (input.value === input.max) input.value = input.min;
      else if (calm.matches) input.stepUp();
      if (calm.matches) return show(); // who asked for little motion goes step by step
      mine = play();
    });
  });

  // A picture that is drawn much smaller than it was made can be opened over the whole window, controls and all.
  const enlarge = part("enlarge"), body = part("body");
  const open = () => {
    const dialog = document.createElement("dialog"), close = document.createElement("button");
    dialog.className = "explorer-dialog";
    dialog.setAttribute("aria-label", root.getAttribute("aria-label"));
    close.type = "button";
    close.className = "explorer-close";
    close.textContent = "Close";
    // In one step: the browser tells of "close" only later, and till then neither picture nor focus would be there.
    const shut = () => {
      if (!dialog.isConnected) return;
      root.prepend(body);
      dialog.close();
      dialog.remove();
      enlarge.focus();
    };
    close.addEventListener("click", shut);
    dialog.addEventListener("cancel", shut); // Escape, or a phone's Back
    dialog.addEventListener("close", shut);
    dialog.append(close, body);
    root.append(dialog);
    dialog.showModal();
  };
  enlarge.addEventListener("click", open);
  image.addEventListener("click", () => {
    if (swipe?.moved) return;
    if (!enlarge.hidden) open();
    else if (!body.closest("dialog")) controls[current].querySelector("input[type=range], input:checked").focus();
  });
  new ResizeObserver(() => {
    if (image.clientWidth && !body.closest("dialog")) enlarge.hidden = image.clientWidth > 0.75 * data.width;
  }).observe(root);

  // "Surprise me" goes to any other setting of all the controls.
  const surprise = part("surprise"), count = (i) => data.sizes[i];
  surprise.hidden = controls.length < 2;
  surprise.addEventListener("click", () => {
    const at = controls.map(position), next = at.map((_, i) => Math.floor(Math.random() * count(i)));
    if (next.every((p, i) => p === at[i])) next[0] = (at[0] + 1) % count(0);
    root.set(Object.fromEntries(next.map((p, i) => [data.names[i], p])));
  });

  // On the picture, a swipe and, while the explorer has the focus, the wheel turn the control that was used last.
  // Where that can't go further the page scrolls, as it does everywhere else.
  const picture = part("picture");
  let current = 0, travelled = 0, swipe = null;
  const turn = (by) => {
    const before = position(controls[current]), after = before + by;
    if (after < 0 || after >= count(current)) return false;
    stopPlaying?.();
    move(controls[current], after);
    show();
    return true;
  };
  form.addEventListener("focusin", ({ target }) => {
    const used = controls.indexOf(target.closest(".explorer-control"));
    if (used >= 0) current = used;
  });
  picture.addEventListener("wheel", (event) => {
    if (event.ctrlKey || !root.contains(document.activeElement) || body.closest("dialog")) return;
    if (Math.sign(event.deltaY) !== Math.sign(travelled)) travelled = 0;
    travelled += event.deltaMode ? 40 * event.deltaY : event.deltaY;
    if (Math.abs(travelled) < 40) return event.preventDefault();
    if (turn(Math.sign(travelled))) event.preventDefault();
    travelled = 0;
  }, { passive: false });
  picture.addEventListener("pointerdown", (event) => {
    swipe = event.pointerType === "touch" && !body.closest("dialog") ? { from: event.clientX, moved: false } : null;
  });
  picture.addEventListener("pointermove", (event) => {
    if (!swipe || Math.abs(event.clientX - swipe.from) < 24) return;
    swipe.moved = true;
    turn(Math.sign(event.clientX - swipe.from));
    swipe.from = event.clientX;
  });

  form.hidden = false; // without scripts there are no dead controls
  form.addEventListener("submit", (event) => event.preventDefault());
  form.addEventListener("input", (event) => { if (event.isTrusted) stopPlaying?.(); show(); });
  // The browser may have put the controls back to where the reader left them: on Back, on reload.
  addEventListener("pageshow", show);
  if (document.readyState === "complete") show();
}
