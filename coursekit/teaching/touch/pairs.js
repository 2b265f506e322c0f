// Lab 6: one step of ICP.  Drag the scan and its turn, look at the pairs, take a step.
(root, r) => {
  const wall = [];
  // Two walls and a rounded corner, no two gaps alike: equal gaps would let the pairs lock in one place too far.
  const bend = (t) => (t < 2.4 ? [-2 + t, 1.2] : t < 4 ? [0.4 + 1.6 * Math.sin((t - 2.4) * 0.98), 1.2 - 1.6 * (1 - Math.cos((t - 2.4) * 0.98))] : [2, 3.6 - t]);
  for (let i = 0; i < 44; i++) wall.push(bend(0.12 * i + 0.05 * Math.sin(7 * i)));
  const k = r.kit(root, [-3.2, 3.2, -2, 2]), targets = wall.map(() => k.dot("truth", 3)), lines = wall.map(() => k.line("odometry thin")), points = wall.map(() => k.dot("estimate", 3.5)), arm = k.line("odometry thin");
  targets.forEach((d, i) => d(wall[i]));
  const start = [0.35, -0.25, 0.2];
  let steps = 0, settled = false;
  const pose = () => [centre.at[0], centre.at[1], Math.atan2(tip.at[1] - centre.at[1], tip.at[0] - centre.at[0])];
  const nearest = (p) => wall.reduce((best, q) => (Math.hypot(q[0] - p[0], q[1] - p[1]) < Math.hypot(best[0] - p[0], best[1] - p[1]) ? q : best));
  const draw = () => {
    const T = pose(), scan = wall.map((p) => r.transform(T, p)), pairs = scan.map(nearest);
    scan.forEach((p, i) => { points[i](p); lines[i]([p, pairs[i]]); });
    const rms = Math.sqrt(scan.reduce((s, p, i) => s + (p[0] - pairs[i][0]) ** 2 + (p[1] - pairs[i][1]) ** 2, 0) / scan.length);
    arm([centre.at, tip.at]);
    k.say(`The scan is off by x = ${T[0].toFixed(2)} m, y = ${T[1].toFixed(2)} m, θ = ${T[2].toFixed(2)} rad; root mean square of the pairs ${rms.toFixed(3)} m after ${steps} step${steps === 1 ? "" : "s"}${settled ? ": settled, one more step changes nothing" : ""}.`);
    return [scan, pairs];
  };
  const restart = () => { steps = 0; settled = false; };
  const set = ([x, y, t]) => { centre.at = [x, y]; tip.at = [x + Math.cos(t), y + Math.sin(t)]; };
  let centre = { at: start }, tip = { at: [start[0] + 1, start[1]] };
  const told = () => { const T = pose(); return `x ${T[0].toFixed(2)}, y ${T[1].toFixed(2)} metres, turned by ${T[2].toFixed(2)} radians`; };
  centre = k.handle("Place of the scan", start, { told: ([x, y]) => `x ${x.toFixed(2)}, y ${y.toFixed(2)} metres`, place: ([x, y]) => [k.clip(x, -3, 3), k.clip(y, -1.9, 1.9)],
    changed: () => { const t = turn; tip.at = [centre.at[0] + Math.cos(t), centre.at[1] + Math.sin(t)]; restart(); draw(); } });
  let turn = start[2];
  tip = k.handle("Turn of the scan", [start[0] + Math.cos(turn), start[1] + Math.sin(turn)], { told, along: "turn", about: () => centre.at, changed: () => { turn = pose()[2]; restart(); draw(); },
    place: ([x, y]) => { const t = Math.atan2(y - centre.at[1], x - centre.at[0]); return [centre.at[0] + Math.cos(t), centre.at[1] + Math.sin(t)]; } });
  const step = () => {
    if (settled) return draw();
    const [scan, pairs] = draw(), T = r.register(scan, pairs);
    settled = Math.hypot(...T) < 1e-9;
    if (!settled) { set(r.compose(T, pose())); turn = pose()[2]; steps += 1; }
    draw();
  };
  k.button("One step", step);
  k.button("Run until settled", () => { do step(); while (!settled && steps % 200); });
  k.button("Start again", () => { set(start); turn = start[2]; restart(); draw(); });
  draw();
}
