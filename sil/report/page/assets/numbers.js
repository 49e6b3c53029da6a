"use strict";
// Numbers of the page: base64 to typed arrays, where a time stands in them, how a number is written, DOM in one call.
const SIL = {};

SIL.data = JSON.parse(document.getElementById("data").textContent);

SIL.bytes = (text) => {
  const raw = atob(text), out = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) out[i] = raw.charCodeAt(i);
  return out.buffer;
};
SIL.floats = (text) => new Float32Array(SIL.bytes(text));
SIL.doubles = (text) => new Float64Array(SIL.bytes(text));

// A column of a run, decoded when first asked for.
SIL.column = (run, name) => {
  const data = SIL.data.runs[run].data;
  data.decoded ??= {};
  return (data.decoded[name] ??= SIL.floats(data.columns[name]));
};
SIL.timesOf = (run) => {
  const data = SIL.data.runs[run].data;
  return (data.decoded_t ??= SIL.doubles(data.t));
};

// Index of the last time that is not after t; 0 before the first.
SIL.before = (times, t) => {
  let low = 0, high = times.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= t + 1e-9) low = middle; else high = middle - 1;
  }
  return low;
};

SIL.number = (value, digits = 4) => {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-4 || size >= 1e6)) return value.toExponential(digits - 2).replaceAll("-", "−");
  const places = size === 0 ? 0 : Math.max(0, Math.min(6, digits - 1 - Math.floor(Math.log10(size))));
  return value.toFixed(places).replace("-", "−");
};
// For a table of few characters: at most three places behind the point.
SIL.short = (value) => (value === null || value === undefined || Number.isNaN(value) ? "–" : Math.abs(value) >= 1e5 ? SIL.number(value, 3)
  : value.toFixed(Math.abs(value) >= 1000 ? 0 : Math.abs(value) >= 100 ? 1 : Math.abs(value) >= 10 ? 2 : 3).replace(/^-(?=[0.]*$)/, "").replace("-", "−"));
SIL.count = (value) => String(value).replace(/\B(?=(\d{3})+$)/g, "\u202f");
SIL.seconds = (t) => `${parseFloat(t.toFixed(3))} s`;
SIL.micros = (us) => {
  if (us === null || us === undefined) return "–";
  return us < 1000 ? `${SIL.number(us, 3)} µs` : us < 1e6 ? `${SIL.number(us / 1e3, 3)} ms` : `${SIL.number(us / 1e6, 3)} s`;
};

// el("p", {class: "x", onclick: f}, "text", child)
SIL.el = (tag, properties = {}, ...children) => {
  const made = tag.startsWith("svg:") ? document.createElementNS("http://www.w3.org/2000/svg", tag.slice(4))
    : document.createElement(tag);
  for (const [key, value] of Object.entries(properties)) {
    if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else if (value === true) made.setAttribute(key, "");
    else if (value !== false && value !== null && value !== undefined) made.setAttribute(key, value);
  }
  made.append(...children.flat(Infinity).filter((child) => child !== null && child !== undefined && child !== false));
  return made;
};

SIL.css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
