// Lab 4: one correction in one dimension.  Drag what was measured, and how wide each bell is.
(root, r) => {
  const k = r.kit(root, [-0.3, 6.3, -0.45, 2.35]);
  const bell = (m, v) => Array.from({ length: 121 }, (_, i) => { const x = i / 20; return [x, Math.exp(-0.5 * (x - m) ** 2 / v) / Math.sqrt(2 * Math.PI * v)]; });
  k.line("odometry thin")([[0, 0], [6, 0]]);
  for (let m = 0; m <= 6; m++) k.text("middle odometry")([m, -0.3], `${m} m`);
  const curves = ["prediction", "measurement", "estimate"].map((c) => k.line(c)), names = ["prediction", "measurement", "estimate"].map((c) => k.text(c));
  const place = ([x, y]) => [k.clip(x, 0.4, 5.6), k.clip(y, 0.3, 2)];
  const sigma = ([, y]) => 1 / (y * Math.sqrt(2 * Math.PI)); // the grip sits on the bell's top
  const draw = () => {
    const [m, s] = [belief.at[0], sigma(belief.at)], [z, q] = [seen.at[0], sigma(seen.at)];
    const [mean, v] = r.correct1(m, s * s, z, q * q), gain = s * s / (s * s + q * q);
    [[m, s * s], [z, q * q], [mean, v]].forEach(([a, b], i) => {
      curves[i](bell(a, b).map(([x, y]) => [x, Math.min(y, 2.3)]));
      names[i]([0.1, 2.15 - 0.22 * i], `${["predicted", "measured", "corrected"][i]} ${a.toFixed(2)} ± ${Math.sqrt(b).toFixed(2)} m`);
    });
    k.say(`Gain K = ${gain.toFixed(2)}: the mean goes ${(100 * gain).toFixed(0)} % of the way from the prediction to the measurement, to ${mean.toFixed(2)} m, and σ falls to ${Math.sqrt(v).toFixed(2)} m, below both.`);
  };
  const grip = (name, start) => k.handle(name, start, { place, step: 0.05, told: (p) => `mean ${p[0].toFixed(2)} metres, sigma ${sigma(p).toFixed(2)} metres`, changed: draw });
  const belief = grip("Prediction: mean and spread", [2.2, 0.8]), seen = grip("Measurement: mean and spread", [3.8, 1.1]);
  draw();
}
