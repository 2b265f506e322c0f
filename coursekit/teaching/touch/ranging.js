// Lab 2: what a camera measures.  Drag the landmark; range, bearing and the two numbers in the picture follow.
(root, r) => {
  const focal = 530, half = 320, h = 0.5, k = r.kit(root, [-0.6, 6.4, -2.2, 2.2]);
  const edge = Math.atan(half / focal);
  [edge, -edge].forEach((a) => k.line("odometry thin dashed")([[0, 0], [7 * Math.cos(a), 7 * Math.sin(a)]]));
  k.robot("truth")([0, 0, 0], 0.4);
  k.line("odometry thin")([[0, 0], [6.4, 0]]);
  const ray = k.line("measurement"), foot = k.line("prediction thin"), bow = k.line("estimate"), words = k.text("middle"), angle = k.text("estimate"), deep = k.text("prediction middle");
  const draw = () => {
    const p = landmark.at, [range, bearing] = r.see([0, 0, 0], p), inside = Math.abs(bearing) < edge;
    ray([[0, 0], p]); foot([[p[0], 0], p]);
    bow(Array.from({ length: 21 }, (_, i) => [0.8 * Math.cos(bearing * i / 20), 0.8 * Math.sin(bearing * i / 20)]));
    words([p[0] / 2, p[1] / 2 + 0.15], `r = ${range.toFixed(2)} m`);
    angle([0.9, 0.45 * bearing + 0.02], `φ = ${bearing.toFixed(2)} rad`);
    deep([p[0] / 2, -0.25 * Math.sign(p[1] || 1)], `depth r cos φ = ${p[0].toFixed(2)} m`);
    k.say(`Range ${range.toFixed(2)} m, bearing ${bearing.toFixed(2)} rad. ` + (inside
      ? `In the picture the landmark stands ${Math.abs(focal * Math.tan(bearing)).toFixed(0)} px ${bearing > 0 ? "left" : "right"} of the middle and is ${(h * focal / p[0]).toFixed(0)} px tall: its height tells the depth, not the range.`
      : "The landmark is outside the picture: the camera measures nothing."));
  };
  const landmark = k.handle("Landmark", [3.5, 1.1], { place: ([x, y]) => [k.clip(x, 0.8, 6.2), k.clip(y, -2, 2)], told: ([x, y]) => `${x.toFixed(2)} metres ahead, ${Math.abs(y).toFixed(2)} to the ${y < 0 ? "right" : "left"}`, changed: draw });
  draw();
}
