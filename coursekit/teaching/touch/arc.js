// Lab 0: two wheels make an arc.  Drag each wheel's speed; the robot's path over four seconds follows.
(root, r) => {
  const track = 0.6, T = 4, k = r.kit(root, [-1.6, 4.8, -2, 2]);
  k.line("odometry thin dashed")([[-1.6, 0], [4.8, 0]]);
  const path = k.line("truth"), turnedAbout = k.dot("truth", 4), radius = k.line("truth thin dashed"), body = k.robot("truth");
  const arrows = [k.line("estimate"), k.line("measurement")], names = [k.text("estimate"), k.text("measurement")], ghost = k.robot("odometry");
  const speed = (p) => p[0] * 0.5, wheel = [track / 2, -track / 2];
  const draw = () => {
    const [left, right] = grips.map((g) => speed(g.at)), u = [(left + right) / 2, (right - left) / track];
    path(Array.from({ length: 81 }, (_, i) => r.move([0, 0, 0], u, T * i / 80 || 1e-9)));
    const end = r.move([0, 0, 0], u, T), bend = Math.abs(u[1]) < 1e-6 ? Infinity : u[0] / u[1];
    body(end, 0.5); ghost([0, 0, 0], 0.5);
    const near = Math.abs(bend) < 30;
    radius(near ? [[0, 0], [0, bend], end] : []); turnedAbout(near ? [0, bend] : [-99, -99]);
    arrows.forEach((a, i) => a([[0, wheel[i]], [grips[i].at[0], wheel[i]]]));
    names.forEach((n, i) => n([-1.5, wheel[i] + (i ? -0.22 : 0.12)], `${i ? "right" : "left"} ${speed(grips[i].at).toFixed(2)} m/s`));
    k.say(`v = ${u[0].toFixed(2)} m/s, ω = ${u[1].toFixed(2)} rad/s. ` + (near ? `The robot turns about a point ${Math.abs(bend).toFixed(2)} m to its ${bend > 0 ? "left" : "right"}` : "The robot drives straight") + `; after ${T} s it stands at x = ${end[0].toFixed(2)} m, y = ${end[1].toFixed(2)} m, θ = ${end[2].toFixed(2)} rad.`);
  };
  const grips = [];
  const grip = (i, name, start) => k.handle(`Speed of the ${name} wheel`, [start, wheel[i]], { step: 0.04, along: "x", place: ([x]) => [k.clip(x, -1.2, 1.6), wheel[i]], told: (p) => `${speed(p).toFixed(2)} metres a second`, changed: draw });
  grips.push(grip(0, "left", 0.7)); grips.push(grip(1, "right", 1.2));
  draw();
}
