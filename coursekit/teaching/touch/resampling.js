// Lab 7: systematic resampling.  Drag a bar's top to change a weight, drag the comb; count the copies.
(root, r) => {
  const n = 6, k = r.kit(root, [-0.4, 6.4, -1.1, 2.3]), colours = ["estimate", "measurement", "band", "prediction", "truth", "odometry"];
  const bars = colours.map((c) => k.line(`${c} filled`, true)), strips = colours.map((c) => k.line(`${c} filled`, true)), comb = colours.map(() => k.line("truth")), counts = colours.map(() => k.text("middle"));
  k.line("odometry thin")([[-0.2, 0], [6.2, 0]]);
  const draw = () => {
    const weights = grips.map((g) => Math.max(g.at[1], 0)), total = weights.reduce((a, b) => a + b, 0) || 1, u = shift.at[0], chosen = r.systematic(weights, u);
    let edge = 0;
    weights.forEach((w, i) => {
      bars[i]([[i + 0.1, 0], [i + 0.1, w], [i + 0.9, w], [i + 0.9, 0]]);
      const next = edge + 6 * w / total;
      strips[i]([[edge, -0.55], [edge, -0.3], [next, -0.3], [next, -0.55]]);
      edge = next;
      counts[i]([i + 0.5, -0.2], `${chosen.filter((c) => c === i).length} ×`);
      comb[i]([[i + u, -0.7], [i + u, -0.25]]);
    });
    const ess = total * total / weights.reduce((s, w) => s + w * w, 0);
    k.say(`Copies ${colours.map((_, i) => chosen.filter((c) => c === i).length).join(", ")}. Each is n w rounded down or up, n w = ${weights.map((w) => (6 * w / total).toFixed(2)).join(", ")}. Effective sample size ${ess.toFixed(1)} of ${n}.`);
  };
  const grips = [];
  [1.2, 0.3, 1.8, 0.6, 0.15, 0.9].forEach((w, i) => grips.push(k.handle(`Weight of particle ${i + 1}`, [i + 0.5, w], { along: "y", place: ([, y]) => [i + 0.5, k.clip(y, 0.01, 2.1)], told: ([, y]) => y.toFixed(2), changed: () => draw() })));
  const shift = k.handle("The random number u that shifts the comb", [0.35, -0.85], { step: 0.02, along: "x", place: ([x]) => [k.clip(x, 0, 0.999), -0.85], told: ([x]) => `u ${x.toFixed(2)}`, changed: () => draw() });
  draw();
}
