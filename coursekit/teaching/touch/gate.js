// Lab 4: one correction in the plane, behind its gate.  Drag where the landmark is seen, and how wide the belief is.
(root, r) => {
  const k = r.kit(root, [-3.2, 3.2, -2, 2]), mean = [-1.7, -0.3, 0.1], landmark = [1.4, 0.4], limit = 9.210340371976184, R = [[0.0064, 0], [0, 0.0016]];
  const gate = k.line("band filled", true), before = k.line("prediction", true), after = k.line("estimate", true), ray = k.line("measurement thin dashed");
  const robots = [k.robot("prediction"), k.robot("estimate")], name = k.text("truth"), label = k.text("prediction");
  k.dot("truth", 6)(landmark); name([landmark[0] + 0.12, landmark[1] - 0.25], "landmark");
  const covariance = () => { const s = 0.1 + wide.at[0] - mean[0] - 0.2; return [[s * s, 0, 0], [0, s * s, 0], [0, 0, (0.15 * s + 0.02) ** 2]]; };
  const rim = (at, P, squared) => r.ellipse([[P[0][0], P[0][1]], [P[1][0], P[1][1]]], squared).map(([x, y]) => [at[0] + x, at[1] + y]);
  const place = (z) => [mean[0] + z[0] * Math.cos(mean[2] + z[1]), mean[1] + z[0] * Math.sin(mean[2] + z[1])];
  const draw = () => {
    const P = covariance(), expected = r.see(mean, landmark), z = r.see(mean, seen.at);
    const [x, Q, nis] = r.correct(mean, P, landmark, z, R), open = nis <= limit, [m, C] = open ? [x, Q] : [mean, P];
    label([wide.at[0] + 0.24, wide.at[1] - 0.05], `belief σ ${Math.sqrt(P[0][0]).toFixed(2)} m`);
    gate(r.ellipse(r.innovation(mean, P, landmark, R), limit).map(([a, b]) => place([expected[0] + a, expected[1] + b])));
    before(rim(mean, P)); after(open ? rim(m, C) : []);
    robots[0](mean, 0.4); robots[1](open ? m : [-99, -99, 0], 0.4); ray([open ? m : mean, seen.at]);
    k.say(`Innovation: range ${(z[0] - expected[0]).toFixed(2)} m, bearing ${r.wrap(z[1] - expected[1]).toFixed(2)} rad; NIS ${nis.toFixed(1)}, gate ${limit.toFixed(2)}. ` + (open
      ? `Taken: the robot moves ${Math.hypot(m[0] - mean[0], m[1] - mean[1]).toFixed(2)} m, and the area of its ellipse falls to ${(100 * Math.sqrt((C[0][0] * C[1][1] - C[0][1] ** 2) / (P[0][0] * P[1][1]))).toFixed(0)} %.`
      : "Refused: the belief stays as it was."));
  };
  const seen = k.handle("Where the landmark is seen", [1.7, 0.65], { place: ([x, y]) => [k.clip(x, -0.6, 3), k.clip(y, -1.8, 1.8)], told: (p) => `${p[0].toFixed(2)}, ${p[1].toFixed(2)} metres`, changed: () => draw() });
  const wide = k.handle("Spread of the belief", [mean[0] + 0.32, mean[1] - 0.9], { step: 0.02, along: "x", place: ([x]) => [mean[0] + k.clip(x - mean[0], 0.14, 0.55), mean[1] - 0.9], told: ([x]) => `sigma ${(0.1 + x - mean[0] - 0.2).toFixed(2)} metres`, changed: () => draw() });
  draw();
}
