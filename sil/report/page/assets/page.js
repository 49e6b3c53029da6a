// Puts the page together.
(() => {
  const { el, data } = SIL, { runs } = data, several = runs.length > 1, root = document.documentElement;
  const section = (id, title, ...content) => (content.flat(Infinity).some(Boolean) ? el("section", { id, "aria-labelledby": `${id}-title` }, el("h2", { id: `${id}-title` }, title), content) : null);
  const ofEach = (make) => runs.map((run) => {
    const made = make(run);
    return made && (several ? el("div", { class: "card" }, el("h3", { class: "of-run" }, swatch(run), run.label), made) : el("div", { class: "card" }, made));
  });
  const swatch = (run) => el("span", { class: "swatch", style: `background:var(--run-${runs.indexOf(run) % 7})` });

  // -- header ----------------------------------------------------------------------------------------------------
  const themes = ["auto", "light", "dark"];
  const theme = el("button", { type: "button", class: "plain", onclick: () => setTheme(themes[(themes.indexOf(root.dataset.choice) + 1) % 3], true) });
  function setTheme(choice, keep) {
    root.dataset.choice = choice;
    if (choice === "auto") delete root.dataset.theme; else root.dataset.theme = choice;
    theme.textContent = `${{ auto: "◐", light: "☀", dark: "☾" }[choice]} ${choice}`;
    theme.title = theme.ariaLabel = `colours: ${choice}`;
    if (keep) try { localStorage.setItem("sil-theme", choice); } catch { /* a page from a file may not keep anything */ }
    repaint();
  }
  function repaint() { SIL.forgetColours(); SIL.redrawCharts(); scene?.redraw(); if (several && scene) show(SIL.shown()); }
  const unzoom = el("button", { type: "button", id: "unzoom", class: "plain", hidden: true, onclick: () => SIL.zoomTo(null) }, "whole time");
  const header = el("header", {},
    el("div", { class: "title" }, el("h1", {}, several ? `${runs.length} runs compared` : runs[0].label, several ? tally() : SIL.badge(runs[0].verdict)),
      el("div", { class: "buttons" }, unzoom, theme, el("button", { type: "button", class: "plain", onclick: () => window.print() }, "print"))),
    several ? null : [SIL.inShort(runs[0]), runs[0].about ? el("p", { class: "about" }, runs[0].about) : null, facts(runs[0])],
    runs.filter((run) => run.failure).map((run) => el("p", { class: "failure" }, several ? `${run.label}: ` : "", run.failure)));
  function tally() {
    const verdicts = [...new Set(runs.map((run) => run.verdict))];
    return verdicts.map((verdict) => SIL.badge(verdict, `${runs.filter((run) => run.verdict === verdict).length} ${verdict}`));
  }
  function facts(run) { return el("dl", { class: "facts" }, run.facts.map(([key, value]) => el("div", {}, el("dt", {}, key), el("dd", {}, value)))); }

  // -- stage: view and player ------------------------------------------------------------------------------------
  const motions = runs.map((_, i) => SIL.motionOf(i));
  let chosen = 0, scene = null;
  const canvas = el("canvas", { class: "view", tabindex: "0", role: "img", "aria-label": "satellite" });
  const caption = el("p", { class: "note view-note" });
  const readout = SIL.data.plots.filter((plot) => plot.group === "motion");
  const values = el("table", { class: "readout" });
  const choose = several ? el("label", { class: "choose" }, "satellite of ", el("select", { "aria-label": "run in the 3-D view", onchange(event) { chosen = Number(event.target.value); begin(); } }, runs.map((run, i) => el("option", { value: i }, run.label)))) : null;
  function begin() {
    scene.frame(motions[chosen].frame);
    const frame = motions[chosen].frame === "lvlh" ? "orbital frame: x along-track, z to nadir" : "inertial frame";
    caption.textContent = `${frame}${motions[chosen].ghostIs ? ` · dashed: ${motions[chosen].ghostIs}` : ""}${several ? " · thin: the other runs" : ""} · drag to turn`;
    show(SIL.shown());
  }
  let said = 0;
  function show(t) {
    SIL.showAll(t); SIL.showStrips(t); showReadout(t);
    if (!scene) return;
    const others = several ? motions.map((motion, i) => [motion, i]).filter(([, i]) => i !== chosen).map(([motion, i]) => ({ q: motion.at(t).q, colour: SIL.css(`--run-${i % 7}`) })).filter(({ q }) => !q.some(Number.isNaN)) : [];
    const state = motions[chosen].at(t);
    if (state.q.some(Number.isNaN)) state.q = [1, 0, 0, 0];
    scene.show(state, others);
    if (performance.now() - said > 500) { said = performance.now(); canvas.setAttribute("aria-label", `satellite at ${SIL.seconds(t)}, body x axis along ${scene.axes().x.map((v) => SIL.number(v, 2)).join(", ")} of the reference frame`); }
  }
  const cells = [];
  (() => {
    const columns = [["attitude", "attitude", 0], ["reference", "attitude", 1], ["error", "error", 0], ["torque", "torque", 0], ["wheels", "momentum", 0]];
    const found = columns.map(([name, signal, role]) => {
      const plot = readout.find((each) => each.signal === signal);
      return plot && plot.roles[role] && (name !== "reference" || plot.roles[role][0] === "reference") ? [name, signal, role, plot.unit] : null;
    }).filter(Boolean);
    values.append(el("thead", {}, el("tr", {}, el("td"), found.map(([name, , , unit]) => el("th", { scope: "col" }, name, el("small", {}, unit))))),
      el("tbody", {}, data.axes.map((axis, i) => el("tr", {}, el("th", { scope: "row" }, el("span", { class: "dot", style: `background:var(--axis-${i})` }), axis), found.map(([, signal, role]) => {
        const cell = el("td", { class: "value" });
        cells.push([cell, signal, role, i]);
        return cell;
      })))));
  })();
  function showReadout(t) {
    for (const [cell, signal, role, axis] of cells) {
      const plots = readout.filter((plot) => plot.signal === signal);
      const line = several ? plots[axis].lines[chosen][role] : plots[0].lines[axis][role];
      cell.textContent = line ? SIL.short(SIL.column(line[0], line[1])[SIL.before(SIL.timesOf(line[0]), t)]) : "–";
    }
  }
  const player = SIL.player(show);
  const stage = el("aside", { class: "stage", "aria-label": "satellite and time" }, el("div", { class: "card" }, choose, canvas, caption, values), player.element);

  // -- sections --------------------------------------------------------------------------------------------------
  const plotsOf = (group) => data.plots.filter((plot) => plot.group === group).map(SIL.plotCard);
  const bins = runs.map((run) => run.data.bin);
  const shaded = several ? [] : runs[0].spans.map(({ name }) => name);
  const notes = [
    Math.max(...bins) > 1 ? `A long run is drawn in bins of ${Math.max(...bins)} ticks; smallest and largest value of each are kept.` : null,
    shaded.length ? `Shaded: ${shaded.join(", ")}.` : null,
    "Move the pointer over a plot to look at a time, click to stay there, drag to zoom, double-click for the whole time. Keys: space plays, ← → step (shift: ten), + − 0 zoom.",
  ];
  const others = plotsOf.bind(null, "telemetry");
  const summary = several
    ? el("div", { class: "card" }, SIL.table(["run", "verdict", ...runs[0].facts.map(([key]) => key)], runs.map((run) => [el("span", { class: "of-run" }, swatch(run), run.label), el("td", {}, SIL.badge(run.verdict)), ...runs[0].facts.map(([key]) => el("td", {}, (run.facts.find(([other]) => other === key) ?? [0, "–"])[1]))]), { class: "wide" }),
      data.differences.length ? el("details", { open: data.differences.length < 12 }, el("summary", {}, "what the scenarios differ in"), SIL.table(["key", ...runs.map((run) => run.label)], data.differences.map(([key, ...each]) => [el("td", { class: "code" }, key), ...each.map((value) => el("td", { class: "code" }, value))]), { class: "wide" })) : null)
    : null;
  const motion = plotsOf("motion"), identification = plotsOf("identification"), telemetry = others();
  const content = el("main", { class: "content" },
    several ? section("runs", "Runs", summary) : null,
    section("requirements", "Requirements", ofEach(SIL.requirements)),
    section("motion", "Motion", el("p", { class: "note keys-note" }, notes.filter(Boolean).join(" ")), motion),
    section("metrics", "Metrics", el("div", { class: "card" }, SIL.metrics(runs))),
    section("identification", "Identification", identification),
    section("link", "Link", ofEach((run) => run.link && el("div", {}, SIL.fates(run.link), SIL.counters(run.link), SIL.strips(run.link.strips, run)))),
    section("deadlines", "Deadlines", ofEach((run) => SIL.times(run.times))),
    section("arithmetic", "Arithmetic", ofEach((run) => run.arithmetic && el("div", {}, el("p", { class: "note" }, run.arithmetic.form === "float" ? "The law computed in floating point: only the torque's limits apply." : "The law computed in fixed point: 32 bit registers, 64 bit products, every operation saturates."), SIL.strips(run.arithmetic.strips, run), SIL.registers(run.arithmetic.registers)))),
    section("events", "Events", ofEach((run) => SIL.events(run.events))),
    telemetry.length ? section("telemetry", "Further telemetry", telemetry) : null,
    section("identity", "Versions and hashes", ofEach((run) => el("div", {}, SIL.pairs([...run.identity, ...(run.times.host ?? []).map(([key, value]) => [`host: ${key.replace("_", " ")}`, value])]),
      el("details", {}, el("summary", {}, "the scenario, every value resolved"), el("pre", { tabindex: "0" }, run.scenario))))),
    el("footer", {}, `Made by ${data.made_by} from the logs alone. This page loads nothing from anywhere.`));
  const nav = el("nav", { "aria-label": "sections" }, [...content.querySelectorAll("section")].map((each) => el("a", { href: `#${each.id}` }, each.querySelector("h2").textContent)));
  document.getElementById("page").append(header, nav, el("div", { class: "layout" }, stage, content));

  // -- life ------------------------------------------------------------------------------------------------------
  let choice = "auto";
  try { choice = themes.includes(localStorage.getItem("sil-theme")) ? localStorage.getItem("sil-theme") : "auto"; } catch { /* as above */ }
  setTheme(choice, false);
  SIL.scene = scene = SIL.sceneOn(canvas);
  scene.size();
  begin();
  player.show();
  SIL.watchCharts();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);
  let back = null;
  window.addEventListener("beforeprint", () => {
    back = root.dataset.choice;
    for (const each of document.querySelectorAll("details")) each.open = true;
    for (const chart of SIL.charts) chart.make();
    setTheme("light", false);
  });
  window.addEventListener("afterprint", () => back && setTheme(back, false));
  SIL.readyAfter_ms = performance.now();
})();
