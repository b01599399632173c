"use strict";
/* Figures: the service's Plotly JSON drawn in place when it comes into sight, in the colours of the page's theme. */

/* Plotly sets a few style attributes as text, which the policy refuses; by the object model the same is allowed. */
const setAttribute = Element.prototype.setAttribute;
Element.prototype.setAttribute = function (name, value) {
  if (name === "style") this.style.cssText = value;
  else setAttribute.call(this, name, value);
};

const dark = matchMedia("(prefers-color-scheme: dark)");
const still = matchMedia("(prefers-reduced-motion: reduce)");
const CONFIG = { responsive: true, displaylogo: false, showSendToCloud: false, plotlyServerURL: "", modeBarButtonsToRemove: ["select2d", "lasso2d"] };
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const withQuery = (path, more) => path + (path.includes("?") ? "&" : "?") + new URLSearchParams(more);

function plain(layout) {
  const line = { gridcolor: css("--line"), linecolor: css("--hint"), zeroline: false };
  const axes = Object.fromEntries(Object.entries(layout).filter(([key]) => /^[xy]axis/.test(key)).map(([key, value]) => [key, { ...line, ...value }]));
  return { font: { family: "system-ui, sans-serif", size: 13, color: css("--text") }, paper_bgcolor: css("--ground"), plot_bgcolor: css("--ground"), margin: { l: 70, r: 20, t: 30, b: 60 }, hovermode: "closest", legend: { orientation: "h" }, ...layout, ...axes };
}
const textOf = (markup) => new DOMParser().parseFromString(markup, "text/html").body.textContent;
/* In a narrow place names stand on two lines, and an axis beside many others has two ticks. */
function narrowed(layout) {
  for (const note of layout.annotations ?? []) if (note.xref !== "paper") Object.assign(note, { text: note.text.length > 20 ? note.text.replace(": ", "<br>") : note.text, font: { ...note.font, size: 9 } });
  const many = Object.keys(layout).filter((key) => /^xaxis/.test(key)).length > 3;
  for (const [key, axis] of Object.entries(layout)) {
    if (!/^[xy]axis/.test(key)) continue;
    if (many) Object.assign(axis, { nticks: 2, tickfont: { size: 9 } });
    if (many && key[0] === "x" && axis.title?.text) axis.title = { ...axis.title, text: axis.title.text.replace(" [", "<br>["), font: { size: 9 }, standoff: 2 };
    if (key[0] === "x" && axis.ticktext?.length < 7 && axis.ticktext.some((text) => text.includes("<br>"))) Object.assign(axis, { tickangle: 0, tickfont: { size: 9 } });
    if (key[0] === "y" && axis.ticktext?.some((text) => text.includes("  "))) Object.assign(axis, { ticktext: axis.ticktext.map((text) => text.replace("  ", "<br>")), tickfont: { size: 9 } });
  }
}
function draw(place, figure) {
  place.replaceChildren();
  const layout = { ...figure.layout, autosize: true };
  delete layout.width;
  const narrow = place.clientWidth < 640;
  layout.font = { ...layout.font, size: narrow ? 11 : 13 };
  layout.legend = { ...layout.legend, orientation: "h", yref: "container", yanchor: "bottom", y: 0.005, x: 0.5, xanchor: "center" };
  /* The title is the caption, which a reader of the screen finds; in the drawing it would stand twice. */
  const caption = place.parentElement.querySelector("figcaption");
  const title = caption ? "" : (narrow ? layout.title?.text?.replace(/(.{30,42})\s/g, "$1<br>") : layout.title?.text) ?? "";
  if (caption && layout.title?.text) caption.textContent = textOf(layout.title.text);
  layout.title = { ...layout.title, text: title, font: { size: narrow ? 12 : 14 } };
  /* In a narrow place a name of the legend takes a line, and a title more than one. */
  const names = figure.data.filter((trace) => trace.showlegend !== false && trace.name).length;
  const below = names ? Math.max(95, 70 + 17 * (narrow ? names : Math.ceil(names / 4))) : 60;
  const above = title ? 50 + 15 * (title.split("<br>").length - 1) : 30;
  layout.margin = { r: 20, ...layout.margin, t: above, b: below };
  if (layout.height) layout.height += below - 95 + above - 50;
  if (narrow) narrowed(layout);
  const axes = Object.entries(layout).filter(([key]) => /^[xy]axis/.test(key));
  for (const [, axis] of axes) if (axis.ticktext) axis.automargin = true;
  if (axes.some(([key, axis]) => key === "yaxis" && axis.ticktext)) layout.margin.l = narrow ? 30 : 60;
  const across = axes.filter(([key, axis]) => key[0] === "x" && axis.title?.text);
  if (across.length < 4) for (const [key, axis] of across) layout[key] = { ...axis, title: { ...axis.title, standoff: 8 } };
  return Plotly.newPlot(place, figure.data, layout, CONFIG);
}
/* What is shown stands in the address, so that a colleague who opens it sees the same. */
const shown = new URLSearchParams(location.search);
function keep(changes) {
  for (const [key, value] of Object.entries(changes)) if (value === null) shown.delete(key); else shown.set(key, value);
  const query = shown.toString();
  history.replaceState(null, "", location.pathname + (query && "?" + query) + location.hash);
}
async function get(path) {
  const answer = await fetch(new URL(document.documentElement.dataset.root + "api/v1/" + path, location.href), { credentials: "same-origin", headers: { Accept: "application/json" } });
  const value = await answer.json();
  if (!answer.ok) throw new Error(value.detail);
  return value;
}
const address = (figure) => (figure.dataset.query ? withQuery(figure.dataset.figure, figure.dataset.query) : figure.dataset.figure);
async function show(figure) {
  const place = figure.querySelector(".draw");
  const asked = address(figure);
  sight.unobserve(figure);
  try {
    const found = await get(withQuery(asked, { theme: dark.matches ? "dark" : "light" }));
    if (asked !== address(figure)) return; // something else was chosen in the meantime
    await draw(place, found);
    performance.mark("drawn " + asked);
    figure.classList.remove("quiet");
    figure.dispatchEvent(new CustomEvent("drawn"));
    files(figure);
  } catch (error) {
    const note = document.createElement("p");
    note.className = "wait";
    note.textContent = error.message;
    place.replaceChildren(note);
    figure.classList.add("quiet");
  }
}
function files(figure) {
  let list = figure.querySelector(".files");
  if (!list) { list = document.createElement("p"); list.className = "files"; figure.append(list); }
  const path = address(figure);
  list.replaceChildren(...["svg", "png", "pdf"].map((format) => {
    const link = document.createElement("a");
    link.href = document.documentElement.dataset.root + "api/v1/" + withQuery(path, { format });
    link.textContent = format.toUpperCase();
    link.setAttribute("download", "");
    return link;
  }));
}
const figures = [...document.querySelectorAll("figure[data-figure]")];
const sight = new IntersectionObserver((entries) => entries.forEach((e) => { if (e.isIntersecting) show(e.target); }), { rootMargin: "300px" });
const figureOf = (name) => figures.find((figure) => figure.dataset.figure.endsWith("/figures/" + name));
const goTo = (element, block = "start") => element.scrollIntoView({ behavior: still.matches ? "auto" : "smooth", block });
figures.forEach((figure) => sight.observe(figure));
dark.addEventListener("change", () => location.reload());

/* A figure of which a part is drawn: chosen in a list, named in the address. */
for (const list of document.querySelectorAll("select[data-part-of]")) {
  const figure = figureOf(list.dataset.partOf);
  const key = list.dataset.key;
  const choose = () => { figure.dataset.query = list.selectedOptions[0]?.dataset.query ?? ""; };
  const named = [...list.options].find((option) => option.value === shown.get(key));
  if (named) list.value = named.value;
  choose();
  list.addEventListener("change", () => { choose(); keep({ [key]: list.value }); show(figure); });
}

/* The FRF of a result: chosen by point, zoomed by a mode. */
const choice = document.querySelector("[data-frf-choice]");
const overlay = choice && figureOf("frf");
function frfQuery() {
  const said = new URLSearchParams(choice.selectedOptions[0]?.dataset.query ?? "");
  const [hz, half] = (shown.get("hz") ?? "").split("~").map(Number);
  if (hz && half) { said.set("fmin", Math.max(0, hz - half).toFixed(3)); said.set("fmax", (hz + half).toFixed(3)); }
  overlay.dataset.query = said.toString();
}
if (overlay) {
  const redraw = () => { frfQuery(); show(overlay); };
  const named = [...choice.options].find((option) => option.value === shown.get("frf"));
  if (named) choice.value = named.value;
  frfQuery();
  choice.addEventListener("change", () => { keep({ frf: choice.value }); redraw(); });
  document.querySelector("[data-unzoom]").addEventListener("click", () => { keep({ hz: null }); redraw(); });
  for (const row of document.querySelectorAll("[data-zoom]")) row.addEventListener("click", (event) => {
    event.preventDefault();
    const [hz, damping] = [Number(row.dataset.zoom), Number(row.dataset.damping)];
    keep({ hz: `${Number(hz.toPrecision(7))}~${Number(Math.max(0.25 * hz, 12 * damping * hz).toPrecision(4))}` });
    redraw();
    goTo(document.getElementById("frfs"));
  });
  if (shown.has("hz")) { show(overlay); goTo(document.getElementById("frfs")); }
}

/* A pair of shapes: chosen in two lists, or by a cell of the MAC. */
const shapes = figureOf("shapes");
const [measured, model] = ["measured", "model"].map((side) => document.querySelector(`[data-shape-of=${side}]`));
if (shapes && measured) {
  const choose = (pair) => {
    [measured.value, model.value] = pair ?? ["", ""];
    shapes.dataset.query = pair ? new URLSearchParams({ measured: pair[0], model: pair[1] }).toString() : "";
  };
  const pair = (shown.get("shapes") ?? "").split("~");
  if (pair.length === 2) { choose(pair); show(shapes); goTo(shapes, "center"); }
  const chosen = (which) => { choose(which); keep({ shapes: which ? which.join("~") : null }); show(shapes); };
  for (const list of [measured, model]) list.addEventListener("change", () => {
    const other = list === measured ? model : measured;
    if (list.value && !other.value) other.value = list.value;
    chosen(list.value && other.value ? [measured.value, model.value] : null);
  });
  const mac = figureOf("mac");
  mac?.addEventListener("drawn", () => mac.querySelector(".js-plotly-plot").on("plotly_click", ({ points: [cell] }) => {
    chosen(cell.customdata.map(String));
    goTo(shapes, "center");
  }));
}
/* Measured FRFs of a campaign. */
const select = document.getElementById("frf");
const viewer = document.querySelector("[data-frf-viewer]");
const AFTER = { accelerance: "(m/s²)/N", mobility: "(m/s)/N", receptance: "m/N" };
async function view(id) {
  const place = viewer.querySelector(".draw");
  const option = [...select.options].find((o) => o.value === id);
  for (const point of document.querySelectorAll("[data-point]")) point.classList.toggle("chosen", [option.dataset.response, option.dataset.reference].includes(point.dataset.point));
  for (const format of ["csv", "uff"]) document.getElementById(`frf-${format}`).href = document.documentElement.dataset.root + `api/v1/frfs/${id}/data?format=${format}`;
  let table;
  try { table = await get(`frfs/${id}/data?format=json`); } catch (error) { place.textContent = error.message; return; }
  const [frf] = table.frfs;
  const color = css("--measured");
  const line = (y, yaxis, name) => ({ type: "scatter", mode: "lines", x: table.frequency_hz, y, yaxis, name, line: { color, width: 1.5 }, showlegend: false });
  const magnitude = frf.real.map((re, i) => Math.hypot(re, frf.imag[i]) || null);
  const angle = frf.real.map((re, i) => (Math.atan2(frf.imag[i], re) * 180) / Math.PI);
  const phase = line([], "y2", "phase");
  phase.x = angle.flatMap((value, i) => (Math.abs(value - angle[i - 1]) > 180 ? [table.frequency_hz[i], table.frequency_hz[i]] : [table.frequency_hz[i]]));
  phase.y = angle.flatMap((value, i) => (Math.abs(value - angle[i - 1]) > 180 ? [null, value] : [value])); // a gap where it wraps
  const sizes = magnitude.filter((value) => value);
  const data = [line(magnitude, "y", "magnitude"), phase];
  const coherence = frf.coherence !== null;
  if (coherence) data.push(line(frf.coherence, "y3", "coherence"));
  const layout = plain({
    xaxis: { title: { text: "frequency [Hz]" }, anchor: coherence ? "y3" : "y2" },
    yaxis: { type: "log", title: { text: `${table.quantity} [${AFTER[table.quantity]}]` }, domain: coherence ? [0.48, 1] : [0.38, 1], exponentformat: "power", ...(Math.max(...sizes) > 100 * Math.min(...sizes) ? { dtick: 1 } : {}) },
    yaxis2: { title: { text: "phase [°]" }, domain: coherence ? [0.2, 0.43] : [0, 0.32], tickvals: [-180, -90, 0, 90, 180], range: [-190, 190] },
    ...(coherence ? { yaxis3: { title: { text: "γ²" }, domain: [0, 0.14], range: [0, 1.05] } } : {}),
  });
  await draw(place, { data, layout });
}
if (select && viewer) {
  const choose = (id) => { select.value = id; keep({ frf: id }); view(id); };
  select.addEventListener("change", () => choose(select.value));
  /* A point that was chosen in space or on the grid: its FRFs, one after the other. */
  const showPoint = (point) => {
    const mine = [...select.options].filter((o) => o.dataset.response === point || o.dataset.reference === point);
    if (mine.length) choose(mine[(mine.findIndex((o) => o.value === select.value) + 1) % mine.length].value);
  };
  document.addEventListener("point-chosen", ({ detail }) => showPoint(String(detail.point)));
  for (const point of document.querySelectorAll("[data-point]")) point.addEventListener("click", (event) => { event.preventDefault(); showPoint(point.dataset.point); });
  const named = shown.get("frf");
  const first = [...select.options].find((o) => o.value === named || o.dataset.response === named) ?? select.options[0];
  select.value = first.value;
  const once = new IntersectionObserver((entries) => { if (entries.some((e) => e.isIntersecting)) { once.disconnect(); view(select.value); } }, { rootMargin: "300px" });
  once.observe(viewer);
}

/* Parameters over time, or of results side by side. */
const UNITS = { Pa: [1e-9, "GPa"], s: [1e6, "µs"], m: [1e3, "mm"] };
for (const box of document.querySelectorAll("[data-over-time]")) {
  const rows = JSON.parse(document.getElementById("over-time").textContent);
  const pick = box.querySelector("select");
  const redraw = () => {
    const name = pick.value;
    const there = rows.filter((row) => row.parameters[name]);
    const [scale, unit] = UNITS[there[0]?.parameters[name].unit] ?? [1, there[0]?.parameters[name].unit ?? ""];
    const y = there.map((row) => scale * row.parameters[name].value);
    const error = { type: "data", symmetric: false, color: css("--updated"), array: there.map((row, i) => scale * row.parameters[name].interval[1] - y[i]), arrayminus: there.map((row, i) => y[i] - scale * row.parameters[name].interval[0]) };
    const sameDay = new Set(there.map((row) => row.at.slice(0, 10))).size < there.length;
    const x = sameDay ? there.map((row, i) => `${i + 1}: ${row.name}`) : there.map((row) => row.at);
    const data = [{ type: "scatter", mode: "markers", x, y, text: there.map((row) => row.name), customdata: there.map((row) => row.job), error_y: error, marker: { color: css("--updated"), size: 9 }, showlegend: false }];
    const place = box.querySelector(".draw");
    draw(place, { data, layout: plain({ xaxis: { title: { text: sameDay ? "result" : "performed" }, ...(sameDay ? { type: "category" } : { type: "date" }) }, yaxis: { title: { text: `${name} [${unit}], 95 % interval` } } }) })
      .then(() => place.on("plotly_click", ({ points: [point] }) => location.assign(document.documentElement.dataset.root + "ui/update-jobs/" + point.customdata)));
  };
  pick.addEventListener("change", redraw);
  redraw();
}

/* The raw curve of a coupon. */
const curve = document.querySelector("[data-curve-view]");
async function showCurve(id) {
  curve.hidden = false;
  curve.dataset.figure = `coupons/${id}/figures/curve`;
  await show(curve);
  goTo(curve, "nearest");
}
const curves = [...document.querySelectorAll("[data-curve]")];
for (const button of curves) button.addEventListener("click", () => { keep({ curve: button.dataset.curve }); showCurve(button.dataset.curve); });
if (curves.some((button) => button.dataset.curve === shown.get("curve"))) showCurve(shown.get("curve"));
