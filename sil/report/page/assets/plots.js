// Plots over time: one uPlot each, made when it comes into view, all with one time axis, one cursor and one playhead.
SIL.charts = []; // {plot, u, x, show(t)}
SIL.hover = null; // time under the pointer, s
const DASHES = [[], [7, 4], [2, 3], [9, 3, 2, 3]];
const STYLES = { solid: { width: 1.6 }, dashed: { width: 1.2, dash: [6, 4], over: true }, dotted: { width: 1.2, dash: [1.5, 3] }, faint: { width: 1, alpha: 0.4 } };
const listeners = [];
SIL.onHover = (call) => listeners.push(call);

SIL.plotCard = (plot) => {
  const host = SIL.el("div", { class: "chart" });
  const height = SIL.data.runs.length > 1 ? 176 : plot.group === "motion" ? 216 : 170;
  host.style.height = `${height}px`;
  const legend = legendOf(plot);
  const unit = plot.unit ? SIL.el("span", { class: "unit" }, plot.unit) : null;
  const card = SIL.el("figure", { class: "card plot", id: `plot-${plot.id}`, "aria-label": `${plot.title}, plot over time` },
    SIL.el("figcaption", {}, SIL.el("h3", {}, plot.title, " ", unit), legend.table), host);
  const chart = { plot, host, legend, height, u: null, make() { if (!chart.u) makeChart(chart); }, show(t) { legend.show(t); placeHead(chart, t); } };
  SIL.charts.push(chart);
  return card;
};

SIL.watchCharts = () => {
  const seen = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      const chart = SIL.charts.find((each) => each.host === entry.target);
      chart.visible = entry.isIntersecting;
      if (entry.isIntersecting) { chart.make(); chart.show(SIL.shown()); }
    }
  }, { rootMargin: "200px" });
  SIL.charts.forEach((chart) => seen.observe(chart.host));
};
SIL.showAll = (t) => { for (const chart of SIL.charts) if (chart.visible) chart.show(t); };
SIL.redrawCharts = () => { for (const chart of SIL.charts) if (chart.u) { chart.u.destroy(); chart.u = null; makeChart(chart); } };

const colourOf = (plot, row) => SIL.css(plot.of === "axes" ? `--axis-${row}` : `--run-${row % 7}`);

// Rows by roles, each value at the time shown; a row's button hides and shows its lines.
function legendOf(plot) {
  const hidden = new Set(), cells = [];
  const sample = (row, role, style) => {
    const line = { solid: "solid", faint: "solid", dashed: "dashed", dotted: "dotted" }[style];
    return SIL.el("span", { class: `line ${style}`, style: `border-top-style:${line};${row === null ? "" : `border-color:var(--${plot.of === "axes" ? "axis" : "run"}-${row % 7})`}` });
  };
  const head = SIL.el("tr", {}, SIL.el("td"), plot.roles.map(([name, style]) => SIL.el("th", { scope: "col" }, sample(null, 0, style), name)));
  const body = plot.rows.map((name, row) => {
    if (!plot.lines[row].some(Boolean)) return null; // a run that does not tell this
    const toggle = SIL.el("button", { type: "button", class: "row", "aria-pressed": "true", title: `hide or show ${name}`, onclick() {
      hidden.has(row) ? hidden.delete(row) : hidden.add(row);
      toggle.setAttribute("aria-pressed", String(!hidden.has(row)));
      const chart = SIL.charts.find((each) => each.legend === legend);
      if (chart.u) plot.roles.forEach((_, role) => chart.series[row][role] && chart.u.setSeries(chart.series[row][role], { show: !hidden.has(row) }));
    } }, sample(row, 0, plot.of === "runs" && row >= 7 ? "dashed" : "solid"), name);
    const values = plot.roles.map((_, role) => {
      const cell = SIL.el("td", { class: "value" });
      if (plot.lines[row][role]) cells.push([cell, plot.lines[row][role]]); else cell.textContent = "";
      return cell;
    });
    return SIL.el("tr", {}, SIL.el("th", { scope: "row" }, toggle), values);
  });
  const legend = {
    hidden, table: SIL.el("table", { class: `legend${plot.rows.length > 4 ? " many" : ""}` }, plot.roles.length > 1 ? SIL.el("thead", {}, head) : null, SIL.el("tbody", {}, body)),
    show(t) { for (const [cell, [run, name]] of cells) cell.textContent = SIL.number(valueAt(run, name, t)); },
  };
  return legend;
}

function valueAt(run, name, t) {
  const times = SIL.timesOf(run);
  if (t > SIL.data.runs[run].end_s) return NaN;
  return SIL.column(run, name)[SIL.before(times, t)];
}

// Values as uPlot wants them: null where there is nothing; an angle that jumps over the end of its turn has a gap there.
function drawn(run, name, plot) {
  const values = Array.from(SIL.column(run, name), (value) => (Number.isNaN(value) ? null : value));
  if (plot.angle && SIL.data.runs[run].data.bin === 1)
    for (let i = values.length - 1; i > 0; i--)
      if (values[i] !== null && values[i - 1] !== null && Math.abs(values[i] - values[i - 1]) > 180) values[i] = values[i - 1] = null;
  return values;
}

// One x for all lines; runs with other times are joined, what they lack stays undefined.
function dataOf(plot) {
  const runs = [...new Set(plot.lines.flat().filter(Boolean).map(([run]) => run))], series = plot.rows.map(() => []);
  const tables = runs.map((run) => {
    const table = [SIL.timesOf(run)];
    plot.lines.forEach((roles, row) => roles.forEach((line, role) => {
      if (line && line[0] === run) { table.push(drawn(run, line[1], plot)); (series[row][role] = [run, table.length - 1]); }
    }));
    return table;
  });
  const same = tables.every((table) => table[0].length === tables[0][0].length && table[0].every((t, i) => t === tables[0][0][i]));
  const data = same ? [Array.from(tables[0][0]), ...tables.flatMap((table) => table.slice(1))] : uPlot.join(tables.map((table) => [Array.from(table[0]), ...table.slice(1)]));
  const starts = {};
  let next = 1;
  runs.forEach((run, i) => { starts[run] = next - 1; next += tables[i].length - 1; });
  return { data, series: series.map((roles) => plot.roles.map((_, role) => (roles[role] ? starts[roles[role][0]] + roles[role][1] : 0))) };
}

function makeChart(chart) {
  const { plot, host, legend } = chart, { data, series } = dataOf(plot);
  chart.series = series;
  const lines = Array(data.length - 1);
  series.forEach((roles, row) => roles.forEach((at, role) => {
    if (!at) return;
    const style = STYLES[plot.roles[role][1]], colour = plot.of === "axes" && style.over ? SIL.css(`--over-${row}`) : colourOf(plot, row);
    lines[at - 1] = {
      stroke: colour, width: style.width, alpha: style.alpha ?? 1, show: !legend.hidden.has(row),
      dash: style.dash ?? (plot.of === "runs" ? DASHES[Math.floor(row / 7)] : undefined),
      points: { show: data[0].length < 3 }, spanGaps: !plot.angle, paths: plot.step ? uPlot.paths.stepped({ align: 1 }) : undefined,
    };
  }));
  const faint = SIL.css("--faint"), grid = { stroke: SIL.css("--grid"), width: 1 }, font = "12px system-ui, sans-serif";
  const axis = { stroke: faint, grid, font, ticks: { show: false } };
  chart.u = new uPlot({
    width: Math.max(200, host.clientWidth), height: chart.height, legend: { show: false }, padding: [8, 22, 0, 0],
    scales: { x: { time: false, range: (u, low, high) => SIL.timeRange(low, high) }, y: { distr: plot.log ? 3 : 1, range: plot.log ? undefined : (u, low, high) => roomy(low, high, plot) } },
    series: [{}, ...lines],
    axes: [{ ...axis, size: 30, gap: 4, values: (u, ticks) => ticks.map((t, i) => (i === ticks.length - 1 ? `${plain(t)} s` : plain(t))) },
      { ...axis, size: 58, gap: 6, values: plot.log ? undefined : (u, ticks) => ticks.map(plain) }],
    cursor: { sync: { key: "time", setSeries: false, scales: ["x", null] }, points: { show: false }, y: false, drag: { x: true, y: false, dist: 6 } },
    hooks: { drawClear: [(u) => shade(u)], draw: [(u) => extra(u, plot)], setCursor: [hovered], setScale: [(u, key) => key === "x" && zoomed(u)] },
  }, data, host);
  chart.head = SIL.el("div", { class: "playhead" });
  chart.u.over.append(chart.head);
  clicking(chart.u);
  chart.resize ??= new ResizeObserver(() => chart.u && Math.abs(chart.u.width - host.clientWidth) > 1 && host.clientWidth && chart.u.setSize({ width: host.clientWidth, height: chart.height }));
  chart.resize.observe(host);
  if (SIL.zoom) chart.u.setScale("x", { min: SIL.zoom[0], max: SIL.zoom[1] });
  chart.show(SIL.shown());
}

const plain = (value) => {
  if (value === null) return "";
  const size = Math.abs(value), short = parseFloat(value.toPrecision(7));
  return (size !== 0 && (size < 1e-4 || size >= 1e6) ? short.toExponential() : String(short)).replaceAll("-", "−");
};
function roomy(low, high, plot) {
  if (low === null || high === null) return [-1, 1];
  if (plot.zero && low === 0 && high === 0) return [-1, 1];
  const room = (high - low) * 0.06 || Math.abs(high) * 0.1 || 1;
  return [low - room, high + room];
}

// Times in which something is wrong on purpose (of one run only: of several nobody would know whose).
function shade(u) {
  if (SIL.data.runs.length > 1) return;
  const { ctx, bbox } = u;
  ctx.save();
  ctx.fillStyle = SIL.css("--shade");
  for (const { spans } of SIL.data.runs[0].spans) for (const [from, to] of spans) {
    const a = Math.max(bbox.left, u.valToPos(from, "x", true)), b = Math.min(bbox.left + bbox.width, u.valToPos(to, "x", true));
    if (b > a) ctx.fillRect(a, bbox.top, Math.max(b - a, 2), bbox.height);
  }
  ctx.restore();
}

// Zero line and limits.
function extra(u, plot) {
  const { ctx, bbox } = u, lines = plot.limits.flatMap((limit) => [limit, -limit]).map((value) => [value, [8, 4, 2, 4]]);
  if (plot.zero && !plot.log) lines.push([0, []]);
  ctx.save();
  ctx.strokeStyle = SIL.css("--faint"); ctx.lineWidth = window.devicePixelRatio || 1;
  for (const [value, dash] of lines) {
    const y = u.valToPos(value, "y", true);
    if (y < bbox.top || y > bbox.top + bbox.height) continue;
    ctx.setLineDash(dash); ctx.beginPath(); ctx.moveTo(bbox.left, y); ctx.lineTo(bbox.left + bbox.width, y); ctx.stroke();
  }
  ctx.restore();
}

function hovered(u) {
  const inside = u.cursor.left >= 0, t = inside ? u.posToVal(u.cursor.left, "x") : null;
  if (t === SIL.hover) return;
  SIL.hover = t;
  listeners.forEach((call) => call());
}

function placeHead(chart, t) {
  if (!chart.u || !chart.head) return;
  const { min, max } = chart.u.scales.x, at = chart.u.valToPos(t, "x");
  chart.head.style.display = t < min || t > max ? "none" : "";
  chart.head.style.transform = `translateX(${at}px)`;
}

// A click that is no drag sets the time.
function clicking(u) {
  let down = null;
  u.over.addEventListener("mousedown", (event) => { down = event.clientX; });
  u.over.addEventListener("click", (event) => {
    if (down !== null && Math.abs(event.clientX - down) > 4) return;
    SIL.setTime(u.posToVal(event.clientX - u.over.getBoundingClientRect().left, "x"));
  });
}

// Zoom of one is the zoom of all.
let zooming = false;
SIL.zoom = null;
function zoomed(u) {
  if (zooming) return;
  const { min, max } = u.scales.x, [first] = SIL.timeRange(null, null);
  const end = Math.max(...SIL.data.runs.map((run, i) => SIL.timesOf(i).at(-1)));
  SIL.zoomTo(min <= first + 1e-9 && max >= end - 1e-9 ? null : [min, max]);
}
SIL.zoomTo = (span) => {
  zooming = true;
  SIL.zoom = span;
  const [min, max] = span ?? SIL.timeRange(null, null);
  for (const { u } of SIL.charts) if (u && (u.scales.x.min !== min || u.scales.x.max !== max)) u.setScale("x", { min, max });
  document.getElementById("unzoom").hidden = !span;
  zooming = false;
  requestAnimationFrame(() => SIL.showAll(SIL.shown()));
};
SIL.timeRange = (low, high) => {
  const first = Math.min(...SIL.data.runs.map((_, i) => SIL.timesOf(i)[0])), last = Math.max(...SIL.data.runs.map((run) => run.end_s));
  return low === null || low === undefined || !(high > low) ? [first, last] : [Math.max(low, first), Math.min(high, last)];
};
