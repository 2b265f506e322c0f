(root) => {
  // The page's address holds the setting, so that it can be sent: ?tuning.r_scale=2&tuning.seed=7.  Controls that stand
  // where they began are left out.
  const data = JSON.parse(root.querySelector(".explorer-data").textContent);
  const all = [...document.querySelectorAll(".explorer")], own = root.dataset.explorer, before = all.indexOf(root);
  const taken = all.slice(0, before).some((e) => e.dataset.explorer === own);
  const name = own && !taken ? own : `figure-${before + 1}`;
  const key = (i) => `${name}.${data.names[i]}`;
  const after = (i) => data.sizes.slice(i + 1).reduce((product, n) => product * n, 1);
  const start = data.sizes.map((n, i) => Math.floor(data.first / after(i)) % n);

  const asked = new URLSearchParams(location.search), positions = {};
  data.names.forEach((parameter, i) => {
    const value = asked.get(key(i)), at = data.values[i].findIndex((v) => String(v) === value);
    if (at >= 0) positions[parameter] = at;
  });
  if (Object.keys(positions).length) {
    root.set(positions);
    const [how] = performance.getEntriesByType("navigation"), look = () => root.scrollIntoView({ block: "center" });
    if (!location.hash && how?.type === "navigate") addEventListener("load", look);
  }

  let waiting = null;
  root.addEventListener("explorer", () => {
    clearTimeout(waiting); // browsers allow few changes of the address a second
    waiting = setTimeout(() => {
      const address = new URL(location.href), query = address.searchParams;
      root.at().forEach((p, i) => (p === start[i] ? query.delete(key(i)) : query.set(key(i), data.values[i][p])));
      if (address.href !== location.href) {
        try { history.replaceState(history.state, "", address); } catch { /* a page from disk may not change it */ }
      }
    }, 300);
  });
}
