export default {
  render({ model, el }) {
    // The pictures come from the kernel.  One question is on its way at a time, and only the newest of those that
    // wait is asked after it: the picture never runs behind a queue.
    el.innerHTML = model.get("shell");
    // In its command mode JupyterLab takes the keys of whatever has the focus, unless that says no itself.
    el.querySelectorAll("input, button").forEach((control) => control.setAttribute("data-lm-suppress-shortcuts", "true"));
    const me = crypto.randomUUID();
    let answered = null, waiting = null, address = null;
    const ask = (at, resolve) => { answered = resolve; model.send({ view: me, at }); };
    model.on("msg:custom", (message, [picture]) => {
      if (message.view !== me) return; // another view of the same explorer asked
      if (picture) {
        if (address) URL.revokeObjectURL(address);
        address = URL.createObjectURL(new Blob([picture], { type: "image/png" }));
        message.src = address;
      }
      const done = answered, next = waiting;
      answered = waiting = null;
      if (next) ask(...next);
      done(message);
    });
    explorer(el.querySelector(".explorer"), () => (at) => new Promise((resolve) => {
      if (!answered) return ask(at, resolve);
      waiting?.[1](null);
      waiting = [at, resolve];
    }));
  },
};
