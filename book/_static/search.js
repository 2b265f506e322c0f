// Search by section (book/_ext/sections.py).  Every word that was typed, or one of its synonyms, must be there; headings
// weigh more than prose, whole words more than beginnings, and the whole phrase most.
(() => {
  const { sections, synonyms, last } = window.bookIndex;
  const plain = (text) => text.toLowerCase().normalize("NFKD").replace(/[\u0300-\u036f]/g, "").replace(/[’']/g, "");
  const stem = (word) => (word.length > 4 ? word.replace(/(ings?|ies|ed|es|s)$/, "") : word);
  const book = sections.map(([page, anchor, heading, top, prose]) => ({
    page, anchor, heading, top, prose, title: plain(heading), text: plain(prose), above: plain(top),
  }));

  const weigh = (text, words) => words.reduce((sum, word) => {
    const at = text.indexOf(word);
    if (at < 0) return sum;
    const whole = new RegExp(`(^|[^a-z0-9])${word}`).test(text); // not in the middle of another word
    const times = Math.min(text.split(word).length - 1, 6);
    return sum + (whole ? 1 : 0.2) * (1 + Math.log(times));
  }, 0);

  const search = (query) => {
    const phrase = plain(query).trim(), words = phrase.split(/[^a-z0-9]+/).filter(Boolean).map(stem);
    const others = [phrase, ...phrase.split(/\s+/)].filter((w) => w in synonyms)
      .flatMap((w) => plain(synonyms[w]).split(" ")).map(stem).filter((w) => w.length > 2);
    if (!words.length) return [];
    return book.map((entry) => {
      const own = words.every((w) => entry.title.includes(w) || entry.text.includes(w) || entry.above.includes(w));
      const spread = Math.sqrt(400 / (400 + entry.text.length)) + 0.5; // a long section has every word somewhere
      let score = own ? 10 * weigh(entry.title, words) + 3 * spread * weigh(entry.text, words) : 0;
      if (own && !entry.anchor) score += 12 * weigh(entry.title, words);
      if (score && phrase.includes(" ") && `${entry.title} ${entry.text}`.includes(phrase)) score += 15;
      if (phrase in synonyms && entry.text.includes(plain(synonyms[phrase]))) score += 15; // its name in full
      const met = others.filter((w) => `${entry.title} ${entry.text}`.includes(w)).length;
      if (others.length && met >= Math.min(2, others.length)) {
        score += (3 * weigh(entry.title, others) + spread * weigh(entry.text, others)) / (own ? 6 : 1);
      }
      return { entry, score: last.includes(entry.page) ? score / 1000 : score, words: own ? words : others };
    }).filter(({ score }) => score > 0).sort((a, b) => b.score - a.score).slice(0, 40);
  };

  const excerpt = ({ entry, words }) => {
    const places = words.map((w) => entry.text.indexOf(w)).filter((k) => k >= 0);
    const middle = places.length ? Math.min(...places) : 0;
    const from = middle < 60 ? 0 : entry.prose.lastIndexOf(" ", middle - 60) + 1;
    return `${from ? "… " : ""}${entry.prose.slice(from, from + 220)}${entry.prose.length > from + 220 ? " …" : ""}`;
  };

  const element = (kind, text, parent, attributes = {}) => {
    const made = Object.assign(document.createElement(kind), attributes);
    made.textContent = text;
    parent.append(made);
    return made;
  };

  const show = (query) => {
    const place = document.getElementById("search-results"), found = search(query);
    place.replaceChildren();
    const count = found.length === 1 ? "One section" : `${found.length || "No"} sections`;
    element("p", `${count} for “${query}”.`, place, { className: "search-summary", role: "status" });
    const list = element("ul", "", place, { className: "search-sections" });
    found.forEach((hit) => {
      const item = element("li", "", list), { page, anchor, heading, top } = hit.entry;
      element("a", heading, item, { href: `${page}.html${anchor ? `#${anchor}` : ""}` });
      if (top !== heading) element("span", ` in ${top}`, item, { className: "search-page" });
      element("p", excerpt(hit), item);
    });
  };

  addEventListener("DOMContentLoaded", () => {
    const query = new URLSearchParams(location.search).get("q") ?? "";
    document.querySelectorAll("input[name=q]").forEach((input) => { input.value = query; });
    if (query.trim()) show(query);
  });
})();
