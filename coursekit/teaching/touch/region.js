// Guess first, on a drawing: a point, or an ellipse that should hold 95 % of what is coming; then the truth.
(root, r, { key, extent, scenery, cloud, ellipse, unit }) => {
  const k = r.kit(root, extent), [left, right, bottom, top] = extent, size = 0.1 * (right - left);
  const memory = { // a page from disk, or a careful browser, may have none
    get: () => { try { return JSON.parse(localStorage.getItem(key)); } catch { return null; } },
    set: (value) => { try { localStorage.setItem(key, JSON.stringify(value)); } catch { /* it lasts until reload */ } },
    clear: () => { try { localStorage.removeItem(key); } catch { /* nothing was kept */ } },
  };
  scenery.forEach(({ kind, points, text }) => {
    if (kind.startsWith("robot ")) return points.forEach((pose) => k.robot(kind.slice(6))(pose, 0.05 * (right - left)));
    k.line(kind)(points);
    if (text) k.text(kind)(points[0], text);
  });
  const dots = cloud.map(() => k.dot("truth", cloud.length > 1 ? 1.6 : 6)), hidden = [left - 99, bottom - 99];
  const outline = k.line("estimate filled", true), arms = [k.line("estimate thin"), k.line("estimate thin")];
  const middle = [(left + right) / 2, (bottom + top) / 2];
  let centre = { at: middle }, ends = [{ at: [middle[0] + size, middle[1]] }, { at: [middle[0], middle[1] + size / 2] }];
  // The axes that the reader draws are those of the 95 % contour; the second end stands across the first.
  const axes = () => {
    const [a, b] = ends.map((e) => [e.at[0] - centre.at[0], e.at[1] - centre.at[1]]), long = Math.hypot(...a) || 1e-6;
    const across = [-a[1] / long, a[0] / long];
    return [a, long, across, Math.max(Math.abs(b[0] * across[0] + b[1] * across[1]), 0.004 * (right - left))];
  };
  const squared = ([x, y]) => { // the squared Mahalanobis distance under the drawn ellipse
    const [a, long, across, wide] = axes(), d = [x - centre.at[0], y - centre.at[1]];
    const s = (d[0] * a[0] + d[1] * a[1]) / (long * long), t = (d[0] * across[0] + d[1] * across[1]) / wide;
    return 5.991464547107979 * (s * s + t * t);
  };
  const draw = () => {
    if (!ellipse) return;
    const [a, , across, wide] = axes();
    outline(Array.from({ length: 49 }, (_, i) => { const t = 2 * Math.PI * i / 48, c = Math.cos(t), s = wide * Math.sin(t);
      return [centre.at[0] + c * a[0] + s * across[0], centre.at[1] + c * a[1] + s * across[1]]; }));
    arms.forEach((arm, i) => arm([centre.at, ends[i].at]));
  };
  const inside = ([x, y]) => [k.clip(x, left, right), k.clip(y, bottom, top)];
  const told = ([x, y]) => `${x.toFixed(2)}, ${y.toFixed(2)} ${unit}`;
  let before = middle;
  const step = (right - left) / 128;
  centre = k.handle(ellipse ? "Centre of your ellipse" : "Your guess", middle, { step, place: inside, told, changed: () => {
    ends.forEach((e) => { e.at = [e.at[0] + centre.at[0] - before[0], e.at[1] + centre.at[1] - before[1]]; });
    before = centre.at; draw();
  } });
  if (ellipse) ends = ends.map((e, i) => k.handle(i ? "Width of your ellipse" : "Length and direction of your ellipse", e.at, { step, place: inside, told, changed: draw }));
  const show = (kept) => {
    dots.forEach((d, i) => d(kept ? cloud[i] : hidden));
    lock.hidden = Boolean(kept); again.hidden = root.querySelector(".region-why").hidden = !kept;
    root.querySelectorAll(".touch-handle").forEach((h) => { h.style.display = kept ? "none" : ""; });
    if (!kept) return k.say(ellipse ? "Draw the ellipse that you expect to hold 95 % of them, then lock it in." : "Put the handle where you expect it, then lock it in.");
    if (!ellipse) return k.say(`Your guess is ${Math.hypot(cloud[0][0] - centre.at[0], cloud[0][1] - centre.at[1]).toFixed(2)} ${unit} off.`);
    const d = cloud.map(squared), share = d.filter((v) => v < 5.991464547107979).length / d.length, mean = d.reduce((a, b) => a + b, 0) / d.length;
    const own = squared([0, 1].map((j) => cloud.reduce((sum, p) => sum + p[j], 0) / cloud.length)); // of the cloud's mean alone
    k.say(`Your ellipse holds ${(100 * share).toFixed(0)} % of them; 95 % is right. It gets a score of ${mean < 9.95 ? mean.toPrecision(2) : mean.toFixed(0)}, where 2 is right: ` +
      (mean > 3 ? (mean - own > 3 ? (own > 1 ? "you were too sure, and your ellipse lies beside the cloud." : "you were too sure.") : "your ellipse is large enough, but it lies beside the cloud.")
        : mean < 1.3 ? "you were too modest." : "an honest ellipse."));
  };
  const restore = (kept) => { before = kept[0]; centre.at = kept[0]; ends.forEach((e, i) => { if (ellipse) e.at = kept[i + 1]; }); draw(); };
  const lock = k.button("Lock it in", () => { const kept = [centre.at, ...ends.map((e) => e.at)]; memory.set(kept); show(kept); again.focus(); });
  const again = k.button("Guess again", () => { memory.clear(); show(null); root.querySelector(".touch-handle").focus(); });
  const kept = memory.get();
  if (kept) restore(kept);
  draw(); show(kept);
}
