// The time: a slider, play, speed, keys. SIL.setTime moves it; SIL.shown() is the time under the pointer, or else that.
const SPEEDS = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000];
const WHOLE_RUN_s = 30; // the speed at first is the one that shows the run in about this time

SIL.player = (onTime) => {
  const [first, last] = SIL.timeRange(null, null);
  const step = Math.min(...SIL.data.runs.map((run) => run.period_s)), ticks = Math.round((last - first) / step);
  const wanted = (last - first) / WHOLE_RUN_s, speeds = SPEEDS.filter((speed) => speed >= 0.1 && (last - first) / speed >= 0.5);
  let time = first, speed = speeds.reduce((best, each) => (Math.abs(Math.log(each / wanted)) < Math.abs(Math.log(best / wanted)) ? each : best), speeds[0] ?? 1);
  let playing = false, before = 0;

  const slider = SIL.el("input", { type: "range", id: "time", min: 0, max: ticks, step: 1, value: 0, "aria-label": "time" });
  const clock = SIL.el("output", { for: "time", class: "clock" });
  const play = SIL.el("button", { type: "button", class: "play", "aria-label": "play", title: "play (space)" }, "▶");
  const pick = SIL.el("select", { "aria-label": "speed", title: "speed" }, speeds.map((each) => SIL.el("option", { value: each, selected: each === speed }, `${each} ×`)));
  const show = () => {
    slider.value = Math.round((time - first) / step);
    slider.setAttribute("aria-valuetext", SIL.seconds(time));
    clock.textContent = `${SIL.seconds(SIL.shown())} of ${SIL.seconds(last)}`;
    onTime(SIL.shown());
  };
  const set = (t) => { time = Math.min(last - step, Math.max(first, t)); show(); };
  const frame = (now) => {
    if (!playing) return;
    set(time + ((now - before) / 1000) * speed);
    before = now;
    if (time >= last - step - 1e-9) toggle(false); else requestAnimationFrame(frame);
  };
  const toggle = (on) => {
    playing = on;
    play.textContent = on ? "❚❚" : "▶";
    play.setAttribute("aria-label", on ? "pause" : "play");
    if (!on) return;
    if (time >= last - step - 1e-9) time = first;
    before = performance.now();
    requestAnimationFrame(frame);
  };
  slider.addEventListener("input", () => set(first + Number(slider.value) * step));
  play.addEventListener("click", () => toggle(!playing));
  pick.addEventListener("change", () => { speed = Number(pick.value); });
  document.addEventListener("keydown", (event) => {
    const busy = event.target.closest?.("input:not([type=range]), select, textarea, button, summary, a, .tall");
    if (event.ctrlKey || event.metaKey || event.altKey || (busy && event.key === " ")) return;
    const far = event.shiftKey ? 10 : 1;
    const act = {
      " ": () => toggle(!playing), ArrowLeft: () => set(time - far * step), ArrowRight: () => set(time + far * step),
      Home: () => set(first), End: () => set(last), 0: () => SIL.zoomTo(null), "+": () => zoom(0.5), "-": () => zoom(2),
    }[event.key];
    if (!act || (event.target.tagName === "SELECT")) return;
    act();
    event.preventDefault();
  });
  function zoom(factor) {
    const [low, high] = SIL.zoom ?? [first, last], half = ((high - low) * factor) / 2;
    const span = [Math.max(first, time - half), Math.min(last, time + half)];
    SIL.zoomTo(span[0] <= first && span[1] >= last ? null : span);
  }
  let waiting = false;
  SIL.onHover(() => {
    if (waiting || playing) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; show(); });
  });
  SIL.setTime = set;
  SIL.shown = () => (SIL.hover === null || playing ? time : Math.min(last, Math.max(first, SIL.hover)));
  return { element: SIL.el("div", { class: "player" }, play, SIL.el("div", { class: "track" }, slider, marks(first, last)), pick, clock), show };
};

// Where events are, under the slider.
function marks(first, last) {
  const lines = SIL.data.runs.flatMap((run) => run.events.marks).map((t) => SIL.el("svg:rect", { x: ((t - first) / (last - first)) * 1000, y: 0, width: 2, height: 6, class: "fill warn" }));
  return SIL.el("svg:svg", { class: "marks", viewBox: "0 0 1000 6", preserveAspectRatio: "none", "aria-hidden": "true" }, lines);
}
