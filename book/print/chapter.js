// What paper shows of a page: called in the built page, in a browser, once its scripts have run.
//   prefix   is put before each id, so that the chapters can stand in one document
//   chapters maps the address of each chapter to its prefix
//   online   is where the site is published, or ""
async ({ prefix, chapters, online, site }) => {
  const article = document.querySelector("article.bd-article").cloneNode(true);
  const all = (selector, root = article) => [...root.querySelectorAll(selector)];
  const make = (tag, attributes, ...children) => {
    const made = document.createElement(tag);
    Object.entries(attributes).forEach(([name, value]) => made.setAttribute(name, value));
    made.append(...children);
    return made;
  };

  // An explorer is three frames: its start, then what the text's phrases set, then its controls at their ends.
  const settings = (name, data) => {
    const start = [];
    let rest = data.first;
    for (let i = data.names.length - 1; i >= 0; i--) {
      start[i] = rest % data.values[i].length;
      rest = Math.floor(rest / data.values[i].length);
    }
    const asked = all(".explorer-set").filter((phrase) => name && phrase.dataset.sets === name).map((phrase) => {
      const positions = JSON.parse(phrase.dataset.positions);
      return data.names.map((parameter, i) => positions[parameter] ?? start[i]);
    });
    const ends = data.names.flatMap((_, i) => [data.values[i].length - 1, 0].map((end) => start.with(i, end)));
    const frame = (at) => at.reduce((sum, position, i) => sum * data.values[i].length + position, 0);
    const chosen = [];
    for (const k of [start, ...asked, ...ends].map(frame)) {
      if (chosen.length < 3 && chosen.every((other) => data.frames[other] !== data.frames[k])) chosen.push(k);
    }
    return chosen;
  };
  const still = (explorer) => {
    const data = JSON.parse(explorer.querySelector(".explorer-data").textContent);
    const frames = settings(explorer.dataset.explorer, data).map((k) => {
      // The words end with the setting, in parentheses.
      const words = data.alts[k], setting = words.match(/\(([^()]*(?:\([^()]*\)[^()]*)*)\)$/)?.[1] ?? words;
      return make("figure", {}, make("img", { src: data.frames[k], alt: words }), make("figcaption", {}, setting));
    });
    const where = online ? make("a", { href: online + location.href.slice(site.length) }, "Move it on the page") : "Move it on the page";
    return make("div", { class: "frames" }, ...frames, make("p", {}, where, `, which has ${data.frames.length} pictures.`));
  };
  // The call that makes a figure to move is plumbing: paper shows the figure alone.
  all("div.cell.tag_hide-input:has(.explorer, .touch, .guess, .pad) .cell_input").forEach((input) => (input.closest("details") ?? input).remove());
  all(".explorer").forEach((explorer) => explorer.replaceWith(still(explorer)));

  all(".guess").forEach((guess) => {
    const why = guess.querySelector(".guess-why");
    if (guess.querySelector("form")) guess.querySelector("form").replaceWith(make("p", {}, "Your guess: ………… give or take …………"));
    if (why) why.replaceWith(make("p", { class: "why" }, "Once you have guessed: ", ...why.childNodes));
  });
  all(".touch, .pad").forEach((figure) => figure.after(make("p", { class: "touch-note" }, "On the page you can drag this figure.")));

  all("details").forEach((fold) => { fold.open = true; });
  all("[hidden], script, .explorer style, noscript, button, form, input, .headerlink, .d-print-none, .symbol-card").forEach((part) => part.remove());
  all("img").forEach((image) => { image.loading = "eager"; image.src = new URL(image.getAttribute("src"), location.href).href; });
  // A photograph is written into a PDF pixel by pixel, unless it is a JPEG.
  for (const image of all(".frames img")) {
    await image.decode();
    const canvas = make("canvas", { width: image.naturalWidth, height: image.naturalHeight }), pen = canvas.getContext("2d");
    pen.fillStyle = "white";
    pen.fillRect(0, 0, canvas.width, canvas.height);
    pen.drawImage(image, 0, 0);
    const photograph = canvas.toDataURL("image/jpeg", 0.88);
    if (photograph.length < canvas.toDataURL("image/png").length / 2) image.src = photograph;
  }
  // A formula's glyphs: shared in the page, and so with ids of their own.
  const cache = document.querySelector("#MJX-SVG-global-cache");
  if (cache) article.prepend(cache.parentElement.tagName === "BODY" ? cache.cloneNode(true) : cache.parentElement.cloneNode(true));
  all("mjx-assistive-mml").forEach((part) => part.remove());

  all("a[href]").forEach((link) => {
    const [address, anchor = ""] = new URL(link.getAttribute("href"), location.href).href.split("#");
    if (address in chapters) link.setAttribute("href", `#${chapters[address]}${anchor && "--" + anchor}`);
    else if (!address.startsWith(site)) return;
    else if (online) link.setAttribute("href", online + address.slice(site.length));
    else link.removeAttribute("href");
  });
  for (const part of all("*")) {
    if (part.id) part.id = `${prefix}--${part.id}`;
    for (const name of ["xlink:href", "href"]) {
      const value = part.tagName !== "A" && part.getAttribute(name);
      if (value && value.startsWith("#")) part.setAttribute(name, `#${prefix}--${value.slice(1)}`);
    }
  }
  const section = make("section", { class: "chapter", id: prefix }, ...article.childNodes);
  return {
    wrong: all("[data-mml-node=merror]", section).map((formula) => formula.textContent),
    html: section.outerHTML,
    headings: all("h1, h2, h3, h4, h5, h6", section).map((h) => ({ level: Number(h.tagName[1]), text: h.textContent.trim(), id: h.closest("section[id]")?.id ?? prefix })),
  };
}
