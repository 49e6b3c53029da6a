// What is not drawn over time: verdict, requirements, metrics, fates, strips, histograms, registers, events, identity.
const { el } = SIL;

SIL.badge = (verdict, text = verdict) => {
  const kind = { passed: "good", failed: "bad", degraded: "warn", interrupted: "warn" }[verdict] ?? "calm";
  const mark = { good: "✓", bad: "✗", warn: "!", calm: "?" }[kind];
  return el("span", { class: `badge ${kind}` }, el("span", { "aria-hidden": "true" }, mark), text);
};

// The requirements in one line, the failed ones by name: what a phone shows first.
SIL.inShort = (run) => {
  const failed = run.require.filter((line) => !line.passed), all = run.require.length;
  if (!all) return null;
  const named = failed.slice(0, 3).map((line) => `${line.requirement}, got ${line.got}`.replace(/(^|[\s,])-(?=\d)/g, "$1−"));
  const text = failed.length ? `${failed.length} of ${all} requirement${all > 1 ? "s" : ""} failed` : all > 1 ? `All ${all} requirements met` : "The one requirement is met";
  return el("p", { class: "short" }, el("a", { href: "#requirements", class: failed.length ? "bad" : "" }, text), failed.length ? `: ${named.join("; ")}${failed.length > 3 ? "; …" : ""}` : null);
};

const table = (head, rows, properties = {}) => el("div", { class: "scroll" }, el("table", properties,
  head ? el("thead", {}, el("tr", {}, head.map((text) => el("th", { scope: "col" }, text)))) : null,
  el("tbody", {}, rows.map((cells) => el("tr", {}, cells.map((cell, i) => (cell instanceof Node && cell.tagName === "TD" ? cell : el(i ? "td" : "th", i ? {} : { scope: "row" }, cell))))))));
SIL.table = table;
const number = (text) => el("td", { class: "value" }, text);

SIL.requirements = (run) => {
  if (!run.require.length) return el("p", { class: "note" }, "The scenario requires nothing.");
  return table(["", "requirement", "got"], run.require.map((line) => [
    el("td", {}, el("span", { class: `mark ${line.passed ? "good" : "bad"}` }, line.passed ? "✓ met" : "✗ failed")),
    el("td", { class: "code" }, line.requirement), number(line.got.replace(/^-/, "−")),
  ]), { class: "wide" });
};

SIL.metrics = (runs) => {
  const several = runs.length > 1, axes = SIL.data.axes;
  const heads = runs[0].metrics.map(([name, unit]) => [name, unit]);
  if (!several) return table(["", ...axes, "unit"], runs[0].metrics.map(([name, unit, values]) => [name, ...axes.map((_, i) => number(values[i] ?? "")), el("td", { class: "unit" }, unit)]), { class: "wide" });
  return table(["", "axis", ...heads.map(([name, unit]) => `${name}, ${unit}`)], runs.flatMap((run) => axes.map((axis, i) => [
    i ? el("td") : run.label, el("td", {}, axis),
    ...heads.map(([name]) => number((run.metrics.find(([other]) => other === name) ?? [0, 0, []])[2][i] ?? "")),
  ])), { class: "wide by-three" });
};

// States over time as bars; times outside of the run do not exist.
SIL.strips = (strips, run) => {
  const first = SIL.timesOf(SIL.data.runs.indexOf(run))[0], span = run.end_s - first;
  const rows = strips.map(({ label, states }) => {
    const bars = states.flatMap(({ kind, spans }) => spans.map(([from, to]) => el("svg:rect", {
      class: `fill ${kind}`, x: ((from - first) / span) * 1000, y: 0, height: 10, width: Math.max(((to - from) / span) * 1000, 2),
    })));
    const found = states.filter(({ ticks }) => ticks);
    const said = found.length ? found.map(({ name, kind, ticks }) => el("span", { class: `key ${kind}` }, `${name} ${SIL.count(ticks)}`)) : el("span", { class: "note" }, "never");
    return el("div", { class: "strip" }, el("div", { class: "strip-head" }, el("span", {}, label), el("span", { class: "keys" }, said)),
      el("div", { class: "strip-bar", onclick(event) {
        const box = event.currentTarget.getBoundingClientRect();
        SIL.setTime(first + ((event.clientX - box.left) / box.width) * span);
      } }, el("svg:svg", { viewBox: "0 0 1000 10", preserveAspectRatio: "none", "aria-hidden": "true" }, bars), el("div", { class: "strip-head-line", "data-first": first, "data-span": span })));
  });
  return el("div", { class: "strips" }, rows, el("div", { class: "strip-axis" }, el("span", {}, SIL.seconds(first)), el("span", {}, "ticks counted, time across"), el("span", {}, SIL.seconds(run.end_s))));
};
SIL.showStrips = (t) => {
  for (const line of document.querySelectorAll(".strip-head-line"))
    line.style.left = `${((t - line.dataset.first) / line.dataset.span) * 100}%`;
};

const FATE_KINDS = ["good", "warn", "bad", "odd", "calm"];
SIL.fates = (link) => link.ways.map((way) => {
  const bar = way.counts.map((count, i) => (count ? el("span", { class: `fill ${FATE_KINDS[i]}`, style: `flex-grow:${count}`, title: `${link.fates[i]} ${count}` }) : null));
  const keys = way.counts.map((count, i) => (count ? el("span", { class: `key ${FATE_KINDS[i]}` }, `${link.fates[i].replace("_", " ")} ${SIL.count(count)}`) : null));
  const copies = way.copies ? el("span", { class: "key calm" }, `further copies ${SIL.count(way.copies)}`) : null;
  return el("div", { class: "way" },
    el("div", { class: "strip-head" }, el("span", {}, el("b", {}, way.way), ` ${way.about}`), el("span", {}, `${SIL.count(way.frames)} frames`)),
    el("div", { class: "stack", role: "img", "aria-label": way.counts.map((count, i) => `${link.fates[i]} ${count}`).join(", ") }, bar), el("div", { class: "keys" }, keys, copies),
    way.causes.length ? table(["fate", "cause", "frames"], way.causes.map(([fate, cause, count]) => [fate, el("td", {}, cause), number(SIL.count(count))])) : null);
});

SIL.counters = (link) => {
  const told = link.counters.filter(([, count]) => count);
  if (!link.counters.length) return null;
  if (!told.length) return el("p", { class: "note" }, "No command missed or late, no CRC error, no byte discarded, no restart.");
  return table(["counted", ""], told.map(([name, count]) => [name, number(SIL.count(count))]));
};

// Bars by decades of time; limit: where late begins.
SIL.histogram = (title, found, limit) => {
  const { edges_us: edges, counts } = found, most = Math.max(...counts);
  const first = counts.findIndex(Boolean), last = counts.length - 1 - [...counts].reverse().findIndex(Boolean);
  const rows = [];
  for (let i = first; i <= last; i++) {
    const late = limit !== null && (i > 0 ? edges[i - 1] : 0) >= limit;
    const label = i < edges.length ? `≤ ${SIL.micros(edges[i])}` : `> ${SIL.micros(edges[edges.length - 1])}`;
    rows.push(el("tr", {}, el("th", { scope: "row" }, label), el("td", { class: "bar" }, el("span", { class: `fill ${late ? "bad" : "calm"}`, style: `width:${counts[i] ? Math.max(0.6, (counts[i] / most) * 100) : 0}%` })), number(SIL.count(counts[i]))));
  }
  const p = found.percentiles_us;
  return el("div", { class: "histogram" }, el("h3", {}, title),
    el("p", { class: "note" }, `p50 ${SIL.micros(p.p50)} · p99 ${SIL.micros(p.p99)} · p99.9 ${SIL.micros(p.p99_9)} · at most ${SIL.micros(p.max)}`),
    el("table", {}, el("tbody", {}, rows)));
};

SIL.times = (times) => {
  if (times.why) return el("p", { class: "note" }, `Nothing is known: ${times.why}.`);
  const { lateness, answer, board } = times;
  const made = [];
  if (lateness) made.push(SIL.histogram("Lateness: wake-up after the deadline", lateness, times.limit_us));
  if (answer) made.push(SIL.histogram("Answer time: SAMPLE sent to COMMAND received", answer, null));
  if (board?.busy) made.push(SIL.histogram("Busy time that the board reports", board.busy, null));
  const notes = [];
  if (!lateness) notes.push(el("p", { class: "note" }, times.paced ? "No tick was late at all." : "Lockstep: nobody waits for a clock, so there is no deadline to be late for. Answer times are those of this machine."));
  if (lateness && times.limit_us) notes.push(el("p", { class: "note" }, `A tick that woke more than ${SIL.micros(times.limit_us)} late is a late tick.`));
  const causes = lateness && times.causes.length ? table(["woke late because of", "ticks", "at most"], times.causes.map(([name, count, most]) => [name, number(SIL.count(count)), number(SIL.micros(most))])) : null;
  const said = board ? el("p", { class: "note" }, `Board: stack ${SIL.count(board.stack_bytes)} bytes, receive errors ${board.rx_errors}, discarded bytes ${board.discarded_bytes}.`) : null;
  return el("div", {}, notes, el("div", { class: "columns" }, made), causes, said);
};

SIL.registers = (registers) => {
  if (!registers.length) return null;
  return el("div", {}, el("h3", {}, "Register use"),
    el("p", { class: "note" }, "Largest value that was recorded of each word, in bits of its 32 bit register: 31 and a sign."),
    table(["word", "largest", "unit", "Q", "bits", ""], registers.map(([name, unit, q, peak, bits]) => [
      el("td", { class: "code" }, name), number(SIL.number(peak)), el("td", { class: "unit" }, unit === "1" ? "" : unit), number(String(q)), number(bits.toFixed(1)),
      el("td", { class: "bar" }, el("span", { class: `fill ${bits > 30.9 ? "bad" : bits > 30 ? "warn" : "calm"}`, style: `width:${(bits / 31) * 100}%` })),
    ]), { class: "wide registers" }));
};

const PRINTED = 40; // events on paper; page.css has the same number
SIL.events = (events) => {
  if (!events.rows.length) return el("p", { class: "note" }, "None.");
  const all = events.counts.reduce((sum, [, count]) => sum + count, 0);
  const rows = events.rows.map(([t, origin, name, text]) => [
    el("td", { class: "value" }, el("button", { type: "button", class: "link", title: "go to this time", onclick: () => SIL.setTime(t) }, SIL.seconds(t))),
    el("td", {}, origin), el("td", { class: "code" }, name), el("td", {}, text),
  ]);
  const left = all > rows.length ? el("p", { class: "note" }, `${SIL.count(all - rows.length)} more of the same kinds are in the log.`) : null;
  const printed = rows.length > PRINTED ? el("p", { class: "note print-only" }, `Printed are the first ${PRINTED} of ${SIL.count(rows.length)}.`) : null;
  return el("div", {}, el("div", { class: "keys" }, events.counts.map(([name, count]) => el("span", { class: "chip" }, `${name} ${SIL.count(count)}`))),
    el("div", { class: "tall", tabindex: "0", role: "region", "aria-label": "list of events" }, table(["time", "from", "event", "what"], rows, { class: "wide" })), printed, left);
};

SIL.pairs = (rows) => table(null, rows.map(([key, value]) => [key, el("td", { class: "code" }, value)]), { class: "pairs" });
