// The 3-D view: body, wheels, reference attitude as a ghost, nadir and velocity, on a 2-D canvas, far things first.
// Points are in the reference frame R. The picture's own frame D has z up: R itself, or, where R is the orbital frame
// with its z to nadir, R turned by half a turn about x. Lengths: the body is 0.6 x 0.5 x 0.4.
SIL.sceneOn = (canvas) => {
  let home = [0, 0], azimuth = 0, elevation = 0, up = 1; // up: sign of D's y and z in R
  let state = null, others = [];
  const size = () => {
    const ratio = window.devicePixelRatio || 1, box = canvas.getBoundingClientRect();
    canvas.width = Math.max(1, Math.round(box.width * ratio));
    canvas.height = Math.max(1, Math.round(box.height * ratio));
    draw();
  };

  function camera() {
    const [ca, sa, ce, se] = [Math.cos(azimuth), Math.sin(azimuth), Math.cos(elevation), Math.sin(elevation)];
    const scale = Math.min(canvas.width, canvas.height * 1.15) * 0.36;
    return (p) => {
      const x = p[0], y = up * p[1], z = up * p[2];
      const depth = ce * ca * x + ce * sa * y + se * z, near = 6 / (6 - depth);
      const right = -sa * x + ca * y, high = -se * ca * x - se * sa * y + ce * z;
      return [canvas.width / 2 + scale * near * right, canvas.height * 0.47 - scale * near * high, depth];
    };
  }

  function draw() {
    if (!state || !canvas.width) return;
    const pen = canvas.getContext("2d"), project = camera(), colours = palette();
    pen.clearRect(0, 0, canvas.width, canvas.height);
    pen.lineJoin = pen.lineCap = "round";
    const unit = (window.devicePixelRatio || 1) * Math.max(0.8, Math.min(1.2, canvas.clientWidth / 380));
    const drawer = { pen, project, colours, unit };
    horizon(drawer);
    const items = [...satellite(state, drawer), ...outside(state, drawer)];
    items.sort((a, b) => a.depth - b.depth).forEach((item) => item.draw());
    for (const other of others) outline(drawer, other.q, other.colour, []);
    if (state.ghost) outline(drawer, state.ghost, colours.ghost, [5 * unit, 4 * unit]);
    labels(state, drawer);
  }

  turning(canvas, (dx, dy) => {
    azimuth -= dx; elevation = Math.max(-1.5, Math.min(1.5, elevation + dy));
    draw();
  }, () => { [azimuth, elevation] = home; draw(); });
  new ResizeObserver(size).observe(canvas);
  return {
    frame(name) {
      up = name === "lvlh" ? -1 : 1;
      [azimuth, elevation] = home = name === "lvlh" ? [-1.02, 0.32] : [0.6, 0.4];
    },
    show(next, outlines = []) { state = next; others = outlines; draw(); },
    redraw: draw, size,
    // In R, as drawn last: where the nose points, and the other body axes.
    axes: () => ({ x: SIL.rotate(state.q, [1, 0, 0]), y: SIL.rotate(state.q, [0, 1, 0]), z: SIL.rotate(state.q, [0, 0, 1]) }),
    // In pixels of the canvas, y down: where a point of R is drawn.
    pixel: (p) => camera()(p).slice(0, 2),
  };
};

const NOSE = [0.5, 0, 0], HALF = [0.3, 0.25, 0.2];
const CORNERS = [0, 1, 2, 3, 4, 5, 6, 7].map((i) => [i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1].map((s, k) => s * HALF[k]));
const FACES = [[1, 3, 7, 5], [0, 4, 6, 2], [2, 6, 7, 3], [0, 1, 5, 4], [4, 5, 7, 6], [0, 2, 3, 1]]; // +x -x +y -y +z -z
const NORMALS = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]];
const CONE = [0, 1, 2, 3, 4, 5, 6, 7].map((i) => [0.3, 0.11 * Math.cos(i * Math.PI / 4), 0.11 * Math.sin(i * Math.PI / 4)]);
const WINGS = [1, -1].map((side) => [0, 1, 2].map((i) => {
  const a = side * (0.33 + 0.21 * i), b = side * (0.33 + 0.21 * i + 0.2);
  return [[-0.17, a, 0], [0.17, a, 0], [0.17, b, 0], [-0.17, b, 0]];
}));
const WHEELS = [[[0.17, 0, 0], 0], [[-0.03, 0.13, 0], 1], [[-0.12, -0.06, 0.06], 2]]; // centre, axis
const ARROWS = [[[0.5, 0, 0], [0.86, 0, 0], "x"], [[0, 0.95, 0], [0, 1.14, 0], "y"], [[0, 0, 0.2], [0, 0, 0.66], "z"]];
const WHEEL_RADIUS = 0.115;

let kept = null;
SIL.forgetColours = () => { kept = null; };
function palette() {
  const read = (name) => SIL.css(name);
  return (kept ??= {
    ink: read("--ink"), faint: read("--faint"), line: read("--line"), body: read("--body"), edge: read("--body-edge"),
    wing: read("--wing"), wingEdge: read("--wing-edge"), ghost: read("--ghost"), earth: read("--earth"), paper: read("--card"),
    axes: [0, 1, 2].map((i) => read(`--axis-${i}`)),
  });
}

const mean = (points) => points.reduce((sum, p) => sum + p[2], 0) / points.length;

function polygon({ pen, unit }, points, fill, edge, alpha, width = 1) {
  return { depth: mean(points), draw() {
    pen.beginPath();
    points.forEach(([x, y], i) => (i ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    pen.closePath();
    if (fill) { pen.globalAlpha = alpha; pen.fillStyle = fill; pen.fill(); }
    pen.globalAlpha = 1;
    if (edge) { pen.strokeStyle = edge; pen.lineWidth = width * unit; pen.stroke(); }
  } };
}

function arrow({ pen, unit }, from, to, colour, width, dash = []) {
  return { depth: (from[2] + to[2]) / 2, draw() {
    const angle = Math.atan2(to[1] - from[1], to[0] - from[0]), length = Math.hypot(to[0] - from[0], to[1] - from[1]);
    const head = Math.min(9 * unit, length);
    pen.strokeStyle = pen.fillStyle = colour;
    pen.lineWidth = width * unit;
    pen.setLineDash(dash);
    pen.beginPath(); pen.moveTo(from[0], from[1]);
    pen.lineTo(to[0] - head * 0.8 * Math.cos(angle), to[1] - head * 0.8 * Math.sin(angle)); pen.stroke();
    pen.setLineDash([]);
    pen.beginPath(); pen.moveTo(to[0], to[1]);
    for (const turn of [2.75, -2.75]) pen.lineTo(to[0] + head * Math.cos(angle + turn), to[1] + head * Math.sin(angle + turn));
    pen.closePath(); pen.fill();
  } };
}

// Body, nose, wings, wheels and body axes.
function satellite(state, drawer) {
  const { project, colours } = drawer;
  const place = (p) => project(SIL.rotate(state.q, p)), items = [];
  const corners = CORNERS.map(place);
  FACES.forEach((face, i) => {
    const light = 0.5 + 0.5 * SIL.rotate(state.q, NORMALS[i]).reduce((sum, n, k) => sum + n * [0.35, -0.5, -0.79][k], 0);
    items.push(polygon(drawer, face.map((k) => corners[k]), shaded(colours.body, light), colours.edge, 0.42, 1.2));
  });
  const tip = place(NOSE), ring = CONE.map(place);
  ring.forEach((p, i) => {
    const item = polygon(drawer, [p, ring[(i + 1) % 8], tip], shaded(colours.axes[0], 0.35 + 0.08 * (i % 8)), null, 0.95);
    items.push(item);
  });
  for (const wing of WINGS) for (const cell of wing) items.push(polygon(drawer, cell.map(place), colours.wing, colours.wingEdge, 0.9, 1));
  WHEELS.forEach(([centre, axis], i) => items.push(wheel(drawer, place, centre, axis, state.wheels[i], colours.axes[i])));
  ARROWS.forEach(([from, to], i) => items.push(arrow(drawer, place(from), place(to), colours.axes[i], 2.4)));
  return items;
}

function wheel(drawer, place, centre, axis, angle, colour) {
  const [a, b] = [(axis + 1) % 3, (axis + 2) % 3];
  const at = (radius, turn) => {
    const p = centre.slice();
    p[a] += radius * Math.cos(turn); p[b] += radius * Math.sin(turn);
    return place(p);
  };
  const rim = Array.from({ length: 28 }, (_, i) => at(WHEEL_RADIUS, (i * Math.PI) / 14));
  const disc = polygon(drawer, rim, colour, colour, 0.45, 2);
  return { depth: disc.depth, draw() {
    disc.draw();
    const { pen, unit } = drawer, [x, y] = place(centre);
    pen.strokeStyle = drawer.colours.paper; pen.lineWidth = 2 * unit;
    for (const turn of [0, 2.0944, 4.1888]) {
      const [px, py] = at(WHEEL_RADIUS * 0.92, angle + turn);
      pen.beginPath(); pen.moveTo(x, y); pen.lineTo(px, py); pen.stroke();
    }
  } };
}

// Nadir and velocity.
function outside(state, drawer) {
  const { project, colours, unit } = drawer, items = [];
  const along = (direction, length) => direction.map((value) => value * length);
  for (const direction of [state.nadir, state.velocity])
    items.push(arrow(drawer, project(along(direction, 0.55)), project(along(direction, 1.08)), colours.faint, 1.8, [2 * unit, 3 * unit]));
  return items;
}

function horizon({ pen, project, colours, unit }) {
  const at = (radius, i) => project([radius * Math.cos((i * Math.PI) / 36), radius * Math.sin((i * Math.PI) / 36), 0]);
  pen.strokeStyle = colours.line; pen.lineWidth = unit;
  pen.beginPath();
  for (let i = 0; i <= 72; i++) { const [x, y] = at(1.1, i); i ? pen.lineTo(x, y) : pen.moveTo(x, y); }
  for (let i = 0; i < 72; i += 3) { const [a, b] = [at(1.1, i), at(i % 18 ? 1.06 : 1.0, i)]; pen.moveTo(a[0], a[1]); pen.lineTo(b[0], b[1]); }
  pen.stroke();
}

// Edges only: the reference attitude, or another run's satellite.
function outline({ pen, project, unit }, q, colour, dash) {
  const place = (p) => project(SIL.rotate(q, p)), corners = CORNERS.map(place), lines = [];
  for (const face of FACES.slice(0, 2)) face.forEach((k, i) => lines.push([corners[k], corners[face[(i + 1) % 4]]]));
  for (let i = 0; i < 8; i += 2) lines.push([corners[i], corners[i + 1]]);
  for (const k of FACES[0]) lines.push([corners[k], place([0.62, 0, 0])]);
  for (const side of [1, -1]) {
    const wing = [[-0.17, 0.33, 0], [0.17, 0.33, 0], [0.17, 0.95, 0], [-0.17, 0.95, 0]].map(([x, y, z]) => place([x, side * y, z]));
    wing.forEach((p, i) => lines.push([p, wing[(i + 1) % 4]]));
  }
  pen.strokeStyle = colour; pen.lineWidth = 1.3 * unit; pen.setLineDash(dash);
  pen.beginPath();
  for (const [a, b] of lines) { pen.moveTo(a[0], a[1]); pen.lineTo(b[0], b[1]); }
  pen.stroke(); pen.setLineDash([]);
}

function labels(state, { pen, project, colours, unit }) {
  const say = (text, p, colour) => {
    const at = project(p), half = pen.measureText(text).width / 2 + 2 * unit;
    const x = Math.max(half, Math.min(pen.canvas.width - half, at[0])), y = Math.max(9 * unit, Math.min(pen.canvas.height - 9 * unit, at[1]));
    pen.textAlign = "center"; pen.textBaseline = "middle";
    pen.lineWidth = 4 * unit; pen.strokeStyle = colours.paper; pen.strokeText(text, x, y);
    pen.fillStyle = colour; pen.fillText(text, x, y);
  };
  pen.font = `600 ${12.5 * unit}px system-ui, sans-serif`;
  ARROWS.forEach(([, to, name], i) => say(name, SIL.rotate(state.q, to.map((v) => v * (i === 1 ? 1.07 : 1.1))), colours.axes[i]));
  pen.font = `${12 * unit}px system-ui, sans-serif`;
  say("nadir", state.nadir.map((v) => v * 1.2), colours.faint);
  say("velocity", state.velocity.map((v) => v * 1.22), colours.faint);
}

// A colour lighter (share above 0.5) or darker.
function shaded(colour, share) {
  const parts = colour.match(/[0-9a-f]{2}/gi).map((part) => parseInt(part, 16));
  const toward = share > 0.5 ? 255 : 0, much = Math.abs(share - 0.5) * 0.9;
  return `rgb(${parts.map((part) => Math.round(part + (toward - part) * much)).join(",")})`;
}

// Drag, or arrow keys while the view has the focus, turn it; a double click puts it back.
function turning(canvas, turn, reset) {
  let last = null;
  canvas.addEventListener("pointerdown", (event) => { last = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
  canvas.addEventListener("pointermove", (event) => {
    if (!last) return;
    turn((event.clientX - last[0]) * 0.008, (event.clientY - last[1]) * 0.008);
    last = [event.clientX, event.clientY];
  });
  for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => { last = null; });
  canvas.addEventListener("dblclick", reset);
  canvas.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[event.key];
    if (!step) return;
    turn(...step);
    event.preventDefault(); event.stopPropagation();
  });
}
