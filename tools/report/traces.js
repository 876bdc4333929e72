// Time axes of the drawn runs, linked; a replay of the vehicle; claims of the text that lead to their run and second.
(() => {
"use strict";
const data = JSON.parse(document.getElementById("flown").textContent), box = document.getElementById("traces");
if (!data.length) return;
const $ = name => box.querySelector(name), MISSING = 65535, MODELS = ["measured", "nominal", "corrected"];
const AROUND = 15, NEAR = 20, LEAST = 1;  // s: shown around a claim, around the replayed vehicle; the shortest axis
let run, plots = [], from = 0, to = 1, at = 0, marked = null, playing = 0, heads = [];

const colour = name => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
const make = (tag, name, parent, text) => {
  const made = document.createElement(tag);
  made.className = name; if (text) made.textContent = text;
  parent.append(made);
  return made;
};
const decode = column => {
  const bytes = Uint8Array.from(atob(column.codes), c => c.charCodeAt(0)), codes = new Uint16Array(bytes.buffer);
  return Array.from(codes, code => code === MISSING ? null : column.low + column.step * code);
};
const less = (a, b) => a.map((value, n) => value === null || b[n] === null ? null : value - b[n]);
const begin = () => run.time[0], end = () => run.time[run.time.length - 1];

function load(n) {  // numbers of a run, once
  const one = data[n];
  if (one.time) return one;
  one.time = decode(one.t);
  for (const chart of one.charts) {
    for (const name of MODELS) chart[name] = decode(chart[name]);
    for (const name of MODELS.slice(1)) chart["off_" + name] = less(chart.measured, chart[name]);
  }
  for (const chart of one.commands) chart.values = decode(chart.values);
  return one;
}

function shade(u, tolerance) {  // behind the lines: what finds a window's start, what is not scored, the tolerance
  const {ctx, bbox} = u, x = value => Math.min(Math.max(u.valToPos(value, "x", true), bbox.left), bbox.left + bbox.width);
  ctx.save();
  for (const [first, start, last, scored] of run.windows) {
    const a = x(first), b = x(scored ? start : last);
    if (b > a) { ctx.fillStyle = colour(scored ? "start" : "unscored"); ctx.fillRect(a, bbox.top, b - a, bbox.height); }
  }
  if (tolerance) {
    const high = Math.max(u.valToPos(tolerance, "y", true), bbox.top);
    const low = Math.min(u.valToPos(-tolerance, "y", true), bbox.top + bbox.height);
    ctx.fillStyle = colour("band"); ctx.fillRect(bbox.left, high, bbox.width, low - high);
  }
  ctx.restore();
}

function plot(parent, {columns, lines, height, down, least, tolerance, ticks, said}) {
  const span = (u, low, high) => {
    if (low === null) return [-1, 1];
    const margin = Math.max(0.06 * (high - low), 0.5 * (least - (high - low)));
    return [low - margin, high + margin];
  };
  const axis = {stroke: colour("soft"), grid: {stroke: colour("grid"), width: 1}, ticks: {stroke: colour("grid"), width: 1, size: 4}, font: "12px system-ui, sans-serif"};
  const u = new uPlot({
    width: Math.max(parent.clientWidth, 200), height, legend: {show: false}, padding: [6, 16, 0, 0],
    cursor: {
      sync: {key: "run", filters: {pub: type => type === "mousemove" || type === "mouseleave"}},
      drag: {x: true, y: false, setScale: false}, points: {show: false}, y: false,
      bind: {dblclick: () => () => zoom(begin(), end())},
    },
    scales: {x: {time: false, range: () => [from, to]}, y: {dir: down ? -1 : 1, range: span}},
    axes: [{...axis, size: ticks ? 26 : 6, gap: 2, values: (self, marks) => marks.map((v, n) => ticks ? (+v.toFixed(3)) + (n === marks.length - 1 ? " s" : "") : "")},
           {...axis, size: 50, gap: 3, space: 24, values: (self, marks) => marks.map(v => String(+v.toFixed(6)).replace("-", "\u2212"))}],
    series: [{}, ...lines.map(name => ({
      label: name, stroke: colour(name), width: name === "measured" ? 3.5 : 1.7, alpha: name === "measured" ? 0.5 : 1,
      dash: name === "nominal" ? [6, 4] : undefined, points: {show: false}, show: shown(name),
    }))],
    hooks: {
      drawClear: [self => shade(self, tolerance)],
      setSelect: [self => {
        if (self.select.width > 4) zoom(self.posToVal(self.select.left, "x"), self.posToVal(self.select.left + self.select.width, "x"));
        self.setSelect({left: 0, width: 0, top: 0, height: 0}, false);
      }],
      setCursor: [self => said && said(self.cursor.idx)],
    },
  }, [run.time, ...columns], parent);
  heads.push({u, head: make("i", "head", u.over), mark: make("i", "mark", u.over)});
  plots.push(u);
}

const shown = name => { const tick = box.querySelector(`input[value="${name}"]`); return !tick || tick.checked; };

function figure(chart, ...gaps) {
  const one = make("figure", "trace", $(".axes")), caption = make("figcaption", "", one);
  make("b", "", caption, `${chart.name}, ${chart.unit}`);
  const value = make("span", "value", caption, gaps.length ? `gap ${gaps[0]}, ${box.dataset.corrected} ${gaps[1]}` : "");
  one.dataset.chart = chart.name;
  return [one, value, value.textContent];
}

function draw() {
  for (const u of plots) u.destroy();
  plots = []; heads = []; $(".axes").replaceChildren();
  for (const chart of run.charts) {
    const [one, value, rest] = figure(chart, ...chart.gap);
    const said = n => { value.textContent = n == null ? rest : MODELS.map(name => `${name} ${chart[name][n] === null ? "\u2013" : (+chart[name][n].toPrecision(4))}`).join(", "); };
    const main = make("div", "plot", one), off = make("div", "plot off", one);
    for (const [element, what] of [[main, "measured, nominal and " + box.dataset.corrected], [off, "measured minus predicted, with the tolerance as a band"]]) {
      element.setAttribute("role", "img");
      element.setAttribute("aria-label", `${chart.name} in ${chart.unit} over time: ${what}; gap ${chart.gap[0]} tolerances, ${box.dataset.corrected} ${chart.gap[1]}`);
    }
    plot(main, {columns: MODELS.map(name => chart[name]), lines: MODELS, height: 150, down: chart.down, least: 4 * chart.tolerance, ticks: false, said});
    plot(off, {columns: MODELS.slice(1).map(name => chart["off_" + name]), lines: MODELS.slice(1), height: 92, down: chart.down, least: 2.6 * chart.tolerance, tolerance: chart.tolerance, ticks: true, said});
  }
  for (const chart of run.commands) {
    const [one] = figure(chart), main = make("div", "plot", one);
    main.setAttribute("role", "img"); main.setAttribute("aria-label", `${chart.name} in ${chart.unit} over time`);
    plot(main, {columns: [chart.values], lines: ["command"], height: 110, least: 1, ticks: true});
  }
  place();
}

function place() {  // playhead and mark in every chart, the replay, and what a reader hears
  const share = value => 100 * (value - from) / (to - from);
  for (const {head, mark} of heads) {
    head.style.left = share(at) + "%"; head.hidden = at < from || at > to;
    mark.hidden = marked === null;
    if (marked !== null) { mark.style.left = share(marked - 1) + "%"; mark.style.width = 200 / (to - from) + "%"; }
  }
  $(".scrub").value = at;
  $(".scrub").setAttribute("aria-valuetext", `${at.toFixed(1)} s`);
  $(".clock").textContent = `${at.toFixed(1)} s`;
  Object.assign(box.dataset, {run: run.name, from: from.toFixed(2), to: to.toFixed(2), at: at.toFixed(2)});
  replay();
}

function zoom(a, b) {
  const whole = end() - begin(), width = Math.min(Math.max(b - a, LEAST), whole);
  from = Math.min(Math.max(a, begin()), end() - width); to = from + width;
  for (const u of plots) u.setScale("x", {min: from, max: to});
  $(".range").textContent = `${run.name}, ${from.toFixed(0)} to ${to.toFixed(0)} s`;
  place();
}

function choose(n, a, b, second) {
  run = load(n);
  [...box.querySelectorAll("[role=tab]")].forEach((tab, k) => { tab.setAttribute("aria-selected", k === n); tab.tabIndex = k === n ? 0 : -1; });
  $(".axes").setAttribute("aria-labelledby", `run-${n}`);
  $(".scrub").min = begin(); $(".scrub").max = end();
  from = begin(); to = end(); at = second ?? begin();
  draw();
  zoom(a ?? begin(), b ?? end());
}

function follow(link) {  // a claim: its run, its second, its chart
  const second = +link.dataset.second, n = +link.dataset.run;
  stop(); marked = second;
  choose(n, second - AROUND, second + AROUND, second);
  const one = $(`figure[data-chart="${link.dataset.chart}"]`);
  box.dataset.chart = link.dataset.chart;
  for (const other of box.querySelectorAll("figure")) other.classList.toggle("claimed", other === one);
  one.tabIndex = -1; one.focus({preventScroll: true});
  one.scrollIntoView({block: "center", behavior: matchMedia("(prefers-reduced-motion: reduce)").matches ? "auto" : "smooth"});
}

// --- the replay: depth over time, with pitch; from above, where north and east were measured
const HULLS = ["nominal", "corrected", "measured"];
function replay() {
  const canvas = $("canvas"), wide = canvas.clientWidth, high = canvas.clientHeight, dots = devicePixelRatio || 1;
  if (!wide) return;
  canvas.width = wide * dots; canvas.height = high * dots;
  const c = canvas.getContext("2d"), named = name => run.charts.find(chart => chart.name === name);
  c.scale(dots, dots);
  const depth = named("depth"), pitch = named("pitch"), north = named("north"), east = named("east");
  if (!depth) return;
  let n = 0, m = run.time.length - 1;
  while (n < m) { const middle = (n + m) >> 1; if (run.time[middle] < at) n = middle + 1; else m = middle; }
  const plan = north && east && wide > 560 ? 0.32 * wide : 0, side = wide - plan;
  const all = MODELS.flatMap(name => depth[name]).filter(v => v !== null);
  const low = Math.min(0, ...all.filter((v, k) => k % 7 === 0)), deep = Math.max(...all.filter((v, k) => k % 7 === 0), low + 1);
  const y = v => 22 + (v - low) / (deep - low) * (high - 44), x = v => side * (0.5 + (v - at) / (2 * NEAR));
  c.font = "12px system-ui, sans-serif"; c.fillStyle = colour("soft"); c.strokeStyle = colour("grid");
  c.beginPath(); c.moveTo(0, y(0)); c.lineTo(side, y(0)); c.stroke();
  c.fillText("surface", 4, y(0) - 5); c.fillText(`${deep.toFixed(1)} m`, 4, high - 6);
  c.save(); c.beginPath(); c.rect(0, 0, side, high); c.clip();
  for (const name of HULLS) {
    if (!shown(name)) continue;
    trail(c, name, k => [x(run.time[k]), depth[name][k] === null ? null : y(depth[name][k])], k => Math.abs(run.time[k] - at) < NEAR);
    if (depth[name][n] !== null && pitch && pitch[name][n] !== null) hull(c, name, x(at), y(depth[name][n]), -pitch[name][n] * Math.PI / 180);
  }
  c.restore();
  if (plan) {
    const seen = [north, east].map(one => MODELS.flatMap(name => one[name]).filter((v, k) => v !== null && k % 7 === 0));
    const [N, E] = seen.map(v => [Math.min(...v), Math.max(...v)]), scale = Math.min((high - 80) / (N[1] - N[0] + 1), (plan - 60) / (E[1] - E[0] + 1));
    const px = v => side + plan / 2 + scale * (v - (E[0] + E[1]) / 2), py = v => high / 2 - scale * (v - (N[0] + N[1]) / 2);
    c.fillStyle = colour("soft"); c.fillText("from above, north up", side + 8, 14);
    for (const name of HULLS) {
      if (!shown(name)) continue;
      const point = k => [east[name][k] === null ? null : px(east[name][k]), north[name][k] === null ? null : py(north[name][k])];
      trail(c, name, point, () => true);
      const yaw = named("yaw"), [a, b] = point(n);
      if (a !== null && b !== null && yaw && yaw[name][n] !== null) hull(c, name, a, b, yaw[name][n] * Math.PI / 180 - Math.PI / 2, 0.6);
    }
  }
}
function trail(c, name, point, near) {
  c.beginPath(); c.strokeStyle = colour(name); c.lineWidth = name === "measured" ? 3 : 1.4; c.globalAlpha = 0.5;
  c.setLineDash(name === "nominal" ? [6, 4] : []);
  let pen = false;
  for (let k = 0; k < run.time.length; k++) {
    const [a, b] = near(k) ? point(k) : [null, null];
    if (a === null || b === null) { pen = false; continue; }
    if (pen) c.lineTo(a, b); else c.moveTo(a, b);
    pen = true;
  }
  c.stroke(); c.setLineDash([]); c.globalAlpha = 1;
}
function hull(c, name, a, b, turn, size = 1) {  // outline of the vehicle, nose along the turn (rad, clockwise)
  c.save(); c.translate(a, b); c.rotate(turn); c.scale(size, size);
  c.beginPath(); c.ellipse(0, 0, 34, 7, 0, 0, 2 * Math.PI); c.moveTo(-26, -4); c.lineTo(-40, -13); c.lineTo(-34, 0); c.moveTo(4, 0); c.lineTo(-10, 0);
  c.lineWidth = 2.2; c.strokeStyle = colour(name); c.fillStyle = colour(name); c.globalAlpha = name === "measured" ? 0.35 : 0.12;
  c.fill(); c.globalAlpha = 1; c.setLineDash(name === "nominal" ? [5, 3] : []); c.stroke(); c.restore();
}

const button = $(".play");
function stop() { cancelAnimationFrame(playing); playing = 0; button.textContent = "Play"; button.setAttribute("aria-pressed", "false"); }
function play() {
  if (playing) return stop();
  button.textContent = "Pause"; button.setAttribute("aria-pressed", "true");
  if (at >= end()) at = begin();
  let last = performance.now();
  const step = now => {
    at = Math.min(at + (now - last) / 1000 * +$(".speed").value, end()); last = now;
    if (at > to && to < end()) zoom(from + (to - from), to + (to - from)); else place();
    if (at >= end()) stop(); else playing = requestAnimationFrame(step);
  };
  playing = requestAnimationFrame(step);
}

const moves = {
  in: () => zoom(from + (to - from) / 4, to - (to - from) / 4), out: () => zoom(from - (to - from) / 2, to + (to - from) / 2),
  left: () => zoom(from - (to - from) / 3, to - (to - from) / 3), right: () => zoom(from + (to - from) / 3, to + (to - from) / 3),
  whole: () => zoom(begin(), end()),
};
const keys = {"+": "in", "=": "in", "-": "out", ArrowLeft: "left", ArrowRight: "right", Home: "whole"};
for (const one of box.querySelectorAll("[data-move]")) one.addEventListener("click", () => moves[one.dataset.move]());
$(".axes").addEventListener("keydown", e => { if (keys[e.key] && !e.ctrlKey && !e.metaKey) { moves[keys[e.key]](); e.preventDefault(); } else if (e.key === " ") { play(); e.preventDefault(); } });
button.addEventListener("click", play);
$(".scrub").addEventListener("input", e => { stop(); at = +e.target.value; if (at < from || at > to) zoom(at - (to - from) / 2, at + (to - from) / 2); else place(); });
for (const tick of box.querySelectorAll(".models input")) tick.addEventListener("change", () => { draw(); });
const tabs = [...box.querySelectorAll("[role=tab]")];
tabs.forEach((tab, n) => {
  tab.addEventListener("click", () => { stop(); marked = null; choose(n); });
  tab.addEventListener("keydown", e => {
    const next = {ArrowRight: n + 1, ArrowLeft: n - 1}[e.key];
    if (next !== undefined && tabs[next]) { tabs[next].click(); tabs[next].focus(); e.preventDefault(); }
  });
});
document.addEventListener("click", e => {
  const link = e.target.closest("a.claim");
  if (link) { e.preventDefault(); follow(link); }
});
let wide = 0;
new ResizeObserver(() => {
  const now = $(".axes").clientWidth;
  if (now === wide) return;
  wide = now;
  for (const u of plots) u.setSize({width: Math.max(u.root.parentNode.clientWidth, 200), height: u.height});
  place();
}).observe($(".axes"));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
addEventListener("beforeprint", () => { document.documentElement.dataset.printed = ""; draw(); });
addEventListener("afterprint", () => { delete document.documentElement.dataset.printed; draw(); });
box.hidden = false;
choose(0);
})();
