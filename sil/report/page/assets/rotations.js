// Rotations as everywhere in attitude-sil: quaternions scalar first, body to reference frame, v_R = q v_B q*.
SIL.rotate = ([s, x, y, z], [a, b, c]) => {
  const u = 2 * (y * c - z * b), v = 2 * (z * a - x * c), w = 2 * (x * b - y * a);
  return [a + s * u + y * w - z * v, b + s * v + z * u - x * w, c + s * w + x * v - y * u];
};

// Between two rotations, the short way, at constant rate; share 0 to 1.
SIL.between = (p, q, share) => {
  let cosine = p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3];
  const sign = cosine < 0 ? -1 : 1;
  cosine = Math.min(1, Math.abs(cosine));
  const angle = Math.acos(cosine), sine = Math.sin(angle);
  const a = sine < 1e-6 ? 1 - share : Math.sin((1 - share) * angle) / sine;
  const b = sign * (sine < 1e-6 ? share : Math.sin(share * angle) / sine);
  const mixed = p.map((value, i) => a * value + b * q[i]);
  const norm = Math.hypot(...mixed);
  return mixed.map((value) => value / norm);
};

// Everything that the 3-D view needs of a run, decoded once; `at(t)` is its state at a time.
SIL.motionOf = (run) => {
  const view = SIL.data.runs[run].view, times = SIL.doubles(SIL.data.runs[run].data.t_view);
  const body = SIL.floats(view.body), ghost = view.ghost ? SIL.floats(view.ghost) : null;
  const nadir = SIL.floats(view.nadir), velocity = SIL.floats(view.velocity), momentum = SIL.floats(view.momentum);
  const turns = wheelTurns(times, momentum);
  const quaternion = (from, i) => Array.from(from.subarray(4 * i, 4 * i + 4));
  const triple = (from, i) => Array.from(from.length === 3 ? from : from.subarray(3 * i, 3 * i + 3));
  const turned = (from, i, share) => {
    const here = quaternion(from, i);
    if (share <= 0 || i + 1 >= times.length) return here;
    const next = quaternion(from, i + 1);
    return next.some(Number.isNaN) ? here : SIL.between(here, next, share);
  };
  return {
    times, frame: view.frame, ghostIs: view.ghost_is,
    at(t) {
      const i = SIL.before(times, t), next = Math.min(i + 1, times.length - 1);
      const share = next > i ? Math.min(1, Math.max(0, (t - times[i]) / (times[next] - times[i]))) : 0;
      const other = ghost ? turned(ghost, i, share) : null;
      return {
        t, q: turned(body, i, share), ghost: other && !other.some(Number.isNaN) ? other : null,
        nadir: triple(nadir, i), velocity: triple(velocity, i), momentum: triple(momentum, i),
        wheels: [0, 1, 2].map((k) => turns[3 * i + k] + share * (turns[3 * next + k] - turns[3 * i + k])),
      };
    },
  };
};

// How far each wheel has turned, rad: the integral of its momentum, scaled so that the fastest turns 60 times in the run.
function wheelTurns(times, momentum) {
  const turns = new Float64Array(momentum.length);
  let peak = 0;
  for (const value of momentum) if (Math.abs(value) > peak) peak = Math.abs(value);
  const span = times[times.length - 1] - times[0] || 1, rate = peak ? (60 * 2 * Math.PI) / (peak * span) : 0;
  for (let i = 1; i < times.length; i++)
    for (let k = 0; k < 3; k++) {
      const mean = (momentum[3 * i + k] + momentum[3 * i - 3 + k]) / 2;
      turns[3 * i + k] = turns[3 * i - 3 + k] + (Number.isFinite(mean) ? mean : 0) * rate * (times[i] - times[i - 1]);
    }
  return turns;
}
