// Lab 7: a small cloud and one beacon.  Drag the beacon or the measured range; weigh, resample, drive on and measure anew.
(root, r) => {
  const n = 80, sigma = 0.3, k = r.kit(root, [-3.2, 3.2, -2, 2]), ring = k.line("measurement", true), thick = [k.line("measurement thin dashed", true), k.line("measurement thin dashed", true)];
  const dots = Array.from({ length: n }, () => k.dot("prediction", 3)), mark = k.line("measurement thin"), real = k.robot("truth"), mean = k.robot("estimate");
  ["truth", "estimate"].forEach((kind, i) => k.text(kind)([-3.1, -1.7 - 0.2 * i], ["true robot", "weighted mean"][i]));
  let cloud, round, truth, edge;
  const scatter = () => {
    const g = k.normals(7, 3 * n);
    cloud = Array.from({ length: n }, (_, i) => [0.9 * g[3 * i], 0.55 * g[3 * i + 1], 0.5 * g[3 * i + 2]]);
    round = 0; truth = [-0.4, 0.2, 0]; edge = false;
  };
  const circle = (c, radius) => Array.from({ length: 61 }, (_, i) => [c[0] + radius * Math.cos(i * Math.PI / 30), c[1] + radius * Math.sin(i * Math.PI / 30)]);
  const weights = () => {
    const range = Math.hypot(tip.at[0] - beacon.at[0], tip.at[1] - beacon.at[1]);
    const log = cloud.map((x) => -0.5 * ((r.see(x, beacon.at)[0] - range) / sigma) ** 2), top = Math.max(...log), w = log.map((l) => Math.exp(l - top)), total = w.reduce((a, b) => a + b, 0);
    return [w.map((v) => v / total), range];
  };
  const draw = () => {
    const [w, range] = weights(), ess = 1 / w.reduce((s, v) => s + v * v, 0);
    ring(circle(beacon.at, range)); thick.forEach((t, i) => t(circle(beacon.at, Math.max(range + (i ? 2 : -2) * sigma, 0.01)))); mark([beacon.at, tip.at]);
    cloud.forEach((x, i) => { dots[i](x); dots[i].radius(1 + 3 * Math.sqrt(Math.min(n * w[i], 9))); });
    const m = [0, 1].map((j) => cloud.reduce((s, x, i) => s + w[i] * x[j], 0)), turn = Math.atan2(cloud.reduce((s, x, i) => s + w[i] * Math.sin(x[2]), 0), cloud.reduce((s, x, i) => s + w[i] * Math.cos(x[2]), 0));
    mean([...m, turn], 0.4); real(truth, 0.4);
    const places = new Set(cloud.map((x) => x.join())).size;
    k.say(`Range measured ${range.toFixed(2)} ± ${sigma.toFixed(1)} m. Effective sample size ${ess.toFixed(0)} of ${n}; ${places} different place${places === 1 ? "" : "s"}; weighted mean x = ${m[0].toFixed(2)} m, y = ${m[1].toFixed(2)} m.${edge ? " The robot has reached the edge: start again." : ""}`);
  };
  const place = ([x, y]) => [k.clip(x, -3, 3), k.clip(y, -1.8, 1.8)], told = (p) => `${p[0].toFixed(2)}, ${p[1].toFixed(2)} metres`;
  const beacon = k.handle("Beacon", [-2.2, 1.2], { place, told, changed: () => draw() }), tip = k.handle("End of the measured range", [-0.4, 0.2], { place, told, changed: () => draw() });
  k.button("Resample", () => { cloud = r.systematic(weights()[0], k.normals(100 + round, 1)[0] ** 2 % 1).map((i) => cloud[i]); round++; draw(); });
  const measure = (noise) => { // the end of a measured range lies in the true robot's direction
    const [range, bearing] = r.see([...beacon.at, 0], truth), z = Math.max(range + sigma * noise, 0.1);
    tip.at = [beacon.at[0] + z * Math.cos(bearing), beacon.at[1] + z * Math.sin(bearing)];
  };
  k.button("Drive on 0.4 m", () => {
    edge = truth[0] + 0.4 > 2.4;
    if (edge) return draw();
    const g = k.normals(200 + round++, 2 * n + 1);
    truth = r.move(truth, [0.4, 0], 1);
    cloud = cloud.map((x, i) => r.move(x, [0.4 + 0.08 * g[2 * i], 0.1 * g[2 * i + 1]], 1));
    measure(g[2 * n]); draw();
  });
  k.button("Start again", () => { beacon.at = [-2.2, 1.2]; tip.at = [-0.4, 0.2]; scatter(); draw(); });
  scatter(); draw();
}
