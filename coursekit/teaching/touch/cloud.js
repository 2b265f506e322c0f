// Lab 7: a small cloud and one beacon.  Drag the beacon or the measured range; weigh, resample, drive on.
(root, r) => {
  const n = 80, sigma = 0.3, k = r.kit(root, [-3.2, 3.2, -2, 2]), ring = k.line("measurement", true), thick = [k.line("measurement thin dashed", true), k.line("measurement thin dashed", true)];
  const dots = Array.from({ length: n }, () => k.dot("prediction", 3)), mark = k.line("measurement thin"), mean = k.robot("estimate");
  let cloud, round;
  const scatter = () => {
    const g = k.normals(7, 3 * n);
    cloud = Array.from({ length: n }, (_, i) => [0.9 * g[3 * i], 0.55 * g[3 * i + 1], 0.5 * g[3 * i + 2]]);
    round = 0;
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
    mean([...m, turn], 0.4);
    k.say(`Range measured ${range.toFixed(2)} ± ${sigma.toFixed(1)} m. Effective sample size ${ess.toFixed(0)} of ${n}; weighted mean x = ${m[0].toFixed(2)} m, y = ${m[1].toFixed(2)} m.`);
  };
  const place = ([x, y]) => [k.clip(x, -3, 3), k.clip(y, -1.8, 1.8)], told = (p) => `${p[0].toFixed(2)}, ${p[1].toFixed(2)} metres`;
  const beacon = k.handle("Beacon", [-2.2, 1.2], { place, told, changed: () => draw() }), tip = k.handle("End of the measured range", [-0.4, 0.2], { place, told, changed: () => draw() });
  k.button("Resample", () => { cloud = r.systematic(weights()[0], k.normals(100 + round, 1)[0] ** 2 % 1).map((i) => cloud[i]); round++; draw(); });
  k.button("Drive on 0.4 m", () => { const g = k.normals(200 + round++, 2 * n); cloud = cloud.map((x, i) => r.move(x, [0.4 + 0.08 * g[2 * i], 0.1 * g[2 * i + 1]], 1)); draw(); });
  k.button("Start again", () => { scatter(); draw(); });
  scatter(); draw();
}
