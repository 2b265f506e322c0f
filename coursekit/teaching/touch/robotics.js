// The few functions that the touched figures share: a translation of `coursekit`, which a test holds equal to 1e-9.
// Poses are [x, y, θ], points [x, y], matrices lists of rows.  SI units and radians.
() => {
  const wrap = (a) => { const w = a - 2 * Math.PI * Math.ceil((a - Math.PI) / (2 * Math.PI)); return w <= -Math.PI ? Math.PI : w; };
  const sinc = (t) => (Math.abs(t) < 1e-9 ? 1 - t * t / 6 : Math.sin(t) / t);
  const slope = (t) => (Math.abs(t) < 1e-3 ? -t / 3 + t ** 3 / 30 : (t * Math.cos(t) - Math.sin(t)) / (t * t));

  // Poses: compose(a, b) is b, given in the frame of a, in the world.
  const transform = ([x, y, t], [px, py]) => [x + Math.cos(t) * px - Math.sin(t) * py, y + Math.sin(t) * px + Math.cos(t) * py];
  const compose = (a, b) => [...transform(a, b), wrap(a[2] + b[2])];
  const inverse = ([x, y, t]) => [-Math.cos(t) * x - Math.sin(t) * y, Math.sin(t) * x - Math.cos(t) * y, wrap(-t)];

  // Matrices, as small as they are here.
  const dot = (A, B) => A.map((row) => B[0].map((_, j) => row.reduce((s, a, k) => s + a * B[k][j], 0)));
  const turned = (A) => A[0].map((_, j) => A.map((row) => row[j]));
  const plus = (A, B, s = 1) => A.map((row, i) => row.map((a, j) => a + s * B[i][j]));
  const inverted2 = ([[a, b], [c, d]]) => { const det = a * d - b * c; return [[d / det, -b / det], [-c / det, a / det]]; };

  // A differential drive over one step: the arc, ∂/∂state, ∂/∂control.
  const move = ([x, y, t], [v, w], dt) => {
    const half = 0.5 * w * dt, chord = v * dt * sinc(half);
    return [x + chord * Math.cos(t + half), y + chord * Math.sin(t + half), wrap(t + w * dt)];
  };
  const F = ([, , t], [v, w], dt) => {
    const half = 0.5 * w * dt, chord = v * dt * sinc(half);
    return [[1, 0, -chord * Math.sin(t + half)], [0, 1, chord * Math.cos(t + half)], [0, 0, 1]];
  };
  const G = ([, , t], [v, w], dt) => {
    const half = 0.5 * w * dt, c = Math.cos(t + half), s = Math.sin(t + half), bend = 0.5 * v * dt * dt;
    const along = dt * sinc(half), across = bend * sinc(half), shorter = bend * slope(half);
    return [[along * c, shorter * c - across * s], [along * s, shorter * s + across * c], [0, dt]];
  };

  // Range and bearing of a landmark, and ∂/∂pose.
  const see = ([x, y, t], [lx, ly]) => [Math.hypot(lx - x, ly - y), wrap(Math.atan2(ly - y, lx - x) - t)];
  const H = ([x, y], [lx, ly]) => {
    const dx = lx - x, dy = ly - y, r = Math.hypot(dx, dy);
    return [[-dx / r, -dy / r, 0], [dy / (r * r), -dx / (r * r), -1]];
  };

  // The Kalman filter's two steps, for a measurement of two numbers whose second is an angle.
  const predict = (x, P, u, M, dt) => {
    const A = F(x, u, dt), B = G(x, u, dt);
    return [move(x, u, dt), plus(dot(dot(A, P), turned(A)), dot(dot(B, M), turned(B)))];
  };
  const correct = (x, P, landmark, z, R) => {
    const J = H(x, landmark), zHat = see(x, landmark), PJ = dot(P, turned(J)), S = plus(dot(J, PJ), R);
    const nu = [[z[0] - zHat[0]], [wrap(z[1] - zHat[1])]], K = dot(PJ, inverted2(S)), step = dot(K, nu);
    const nis = dot(dot(turned(nu), inverted2(S)), nu)[0][0];
    return [[x[0] + step[0][0], x[1] + step[1][0], wrap(x[2] + step[2][0])], plus(P, dot(dot(K, S), turned(K)), -1), nis];
  };
  // Covariance of the innovation, S = H P Hᵀ + R, and d² = vᵀ C⁻¹ v of a planar vector.
  const innovation = (x, P, landmark, R) => { const J = H(x, landmark); return plus(dot(dot(J, P), turned(J)), R); };
  const distance2 = (v, C) => { const w = dot(inverted2(C), [[v[0]], [v[1]]]); return v[0] * w[0][0] + v[1] * w[1][0]; };
  // … and in one dimension: mean and variance.
  const correct1 = (m, v, z, r) => { const k = v / (v + r); return [m + k * (z - m), (1 - k) * v]; };

  // Resamplers, their random numbers given: indices of the chosen particles.
  const under = (weights, positions) => {
    const total = weights.reduce((a, b) => a + b, 0);
    let i = 0, edge = weights[0] / total;
    return positions.map((p) => { while (p >= edge && i < weights.length - 1) edge += weights[++i] / total; return i; });
  };
  const systematic = (weights, u) => under(weights, weights.map((_, i) => (i + u) / weights.length));
  const stratified = (weights, us) => under(weights, us.map((u, i) => (i + u) / us.length));
  const multinomial = (weights, us) => under(weights, [...us].sort((a, b) => a - b));

  // The rotation and shift that bring paired planar points p to q with least squares: T_q_p = [x, y, θ].
  const register = (p, q) => {
    const mean = (points) => [0, 1].map((k) => points.reduce((s, x) => s + x[k], 0) / points.length);
    const a = mean(p), b = mean(q);
    let cosine = 0, sine = 0;
    p.forEach((x, i) => {
      const [px, py] = [x[0] - a[0], x[1] - a[1]], [qx, qy] = [q[i][0] - b[0], q[i][1] - b[1]];
      cosine += px * qx + py * qy;
      sine += px * qy - py * qx;
    });
    const t = Math.atan2(sine, cosine), moved = transform([0, 0, t], a);
    return [b[0] - moved[0], b[1] - moved[1], t];
  };
  // The contour of a planar covariance at a squared Mahalanobis distance, by its Cholesky factor.
  const ellipse = ([[a, b], [, d]], squared = 5.991464547107979, points = 48) => {
    const l = Math.sqrt(a), m = b / l, n = Math.sqrt(Math.max(d - m * m, 0)), s = Math.sqrt(squared);
    return Array.from({ length: points + 1 }, (_, i) => {
      const t = 2 * Math.PI * i / points;
      return [s * l * Math.cos(t), s * (m * Math.cos(t) + n * Math.sin(t))];
    });
  };
  return { wrap, transform, compose, inverse, move, F, G, see, H, predict, correct, innovation, distance2, correct1, systematic, stratified, multinomial, register, ellipse };
}
