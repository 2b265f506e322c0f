// Lab 0: why uncertainty bends.  Drag how far two hundred robots drive, and how much their headings wander.
(root, r) => {
  const n = 200, steps = 25, k = r.kit(root, [-0.8, 11.2, -4, 4]), draws = k.normals(1, n * steps * 2);
  k.line("odometry thin dashed")([[0, 0], [11, 0]]);
  const dots = Array.from({ length: n }, () => k.dot("truth", 2.2)), rim = k.line("estimate", true), robot = k.robot("estimate"), names = [k.text("odometry"), k.text("odometry")];
  k.robot("truth")([0, 0, 0], 0.5);
  const spread = ([, y]) => 0.25 * y; // of the heading at the end [rad]
  const draw = () => {
    const D = far.at[0], s = spread(wander.at), u = [D / steps, 0], sd = [0.1 * Math.sqrt(D / steps), s / Math.sqrt(steps)];
    const M = [[sd[0] ** 2, 0], [0, sd[1] ** 2]];
    let mean = [0, 0, 0], P = [[0, 0, 0], [0, 0, 0], [0, 0, 0]];
    for (let i = 0; i < steps; i++) [mean, P] = r.predict(mean, P, u, M, 1);
    const ends = Array.from({ length: n }, (_, j) => {
      let x = [0, 0, 0];
      for (let i = 0; i < steps; i++) { const d = 2 * (j * steps + i); x = r.move(x, [u[0] + sd[0] * draws[d], sd[1] * draws[d + 1]], 1); }
      return x;
    });
    ends.forEach((x, j) => dots[j](x));
    const block = [[P[0][0], P[0][1]], [P[1][0], P[1][1]]];
    rim(r.ellipse(block).map(([x, y]) => [mean[0] + x, mean[1] + y]));
    robot(mean, 0.5);
    names[0]([D + 0.45, -3.8], `${D.toFixed(1)} m`); names[1]([-0.6, wander.at[1] + 0.35], `heading σ ${s.toFixed(2)} rad`);
    const inside = ends.filter((x) => r.distance2([x[0] - mean[0], x[1] - mean[1]], block) <= 5.991464547107979).length;
    k.say(`After ${D.toFixed(1)} m the headings have spread to ${s.toFixed(2)} rad. The 95 % ellipse holds ${(100 * inside / n).toFixed(0)} % of ${n} endings` + (s > 0.28 ? ": the cloud is bent, and an ellipse cannot bend." : "."));
  };
  const far = k.handle("Distance driven", [6, -3.5], { step: 0.1, along: "x", place: ([x]) => [k.clip(x, 1, 9), -3.5], told: ([x]) => `${x.toFixed(1)} metres`, changed: () => draw() });
  const wander = k.handle("Spread of the heading at the end", [0, 0.8], { step: 0.04, along: "y", place: ([, y]) => [0, k.clip(y, 0.1, 3.4)], told: (p) => `${spread(p).toFixed(2)} radians`, changed: () => draw() });
  draw();
}
