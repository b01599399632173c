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
function draw(place, figure) {
  place.replaceChildren();
  const layout = { ...figure.layout, autosize: true };
  delete layout.width;
  layout.font = { ...layout.font, size: innerWidth < 640 ? 11 : 13 };
  layout.legend = { ...layout.legend, orientation: "h", yref: "container", yanchor: "bottom", y: 0.005, x: 0.5, xanchor: "center" };
  layout.margin = { t: 50, r: 20, ...layout.margin, b: 95 };
  if (layout.title?.text) layout.title = { ...layout.title, font: { size: innerWidth < 640 ? 12 : 14 } };
  return Plotly.newPlot(place, figure.data, layout, CONFIG);
}
async function get(path) {
  const answer = await fetch(new URL(document.documentElement.dataset.root + "api/v1/" + path, location.href), { credentials: "same-origin", headers: { Accept: "application/json" } });
  const value = await answer.json();
  if (!answer.ok) throw new Error(value.detail);
  return value;
}
async function show(figure) {
  const place = figure.querySelector(".draw");
  const path = withQuery(figure.dataset.figure + (figure.dataset.query ? (figure.dataset.figure.includes("?") ? "&" : "?") + figure.dataset.query : ""), { theme: dark.matches ? "dark" : "light" });
  try {
    await draw(place, await get(path));
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
  const path = figure.dataset.figure + (figure.dataset.query ? (figure.dataset.figure.includes("?") ? "&" : "?") + figure.dataset.query : "");
  list.replaceChildren(...["svg", "png", "pdf"].map((format) => {
    const link = document.createElement("a");
    link.href = document.documentElement.dataset.root + "api/v1/" + withQuery(path, { format });
    link.textContent = format.toUpperCase();
    link.setAttribute("download", "");
    return link;
  }));
}
const figures = [...document.querySelectorAll("figure[data-figure]")];
const sight = new IntersectionObserver((entries) => entries.forEach((e) => { if (e.isIntersecting) { sight.unobserve(e.target); show(e.target); } }), { rootMargin: "300px" });
figures.forEach((figure) => sight.observe(figure));
dark.addEventListener("change", () => location.reload());

/* The FRF of a result: chosen by point, zoomed by a mode; both stand in the address. */
const choice = document.querySelector("[data-frf-choice]");
const overlay = figures.find((figure) => /\/figures\/frf$/.test(figure.dataset.figure));
function overlayQuery(more) {
  const said = new URLSearchParams(choice?.value ?? "");
  for (const [key, value] of Object.entries(more ?? {})) said.set(key, value);
  return said.toString();
}
function zoom(hz, damping) {
  const half = Math.max(0.25 * hz, 12 * damping * hz);
  overlay.dataset.query = overlayQuery({ fmin: Math.max(0, hz - half).toFixed(3), fmax: (hz + half).toFixed(3) });
  history.replaceState(null, "", "#frfs=" + hz);
  sight.unobserve(overlay);
  show(overlay);
  document.getElementById("frfs").scrollIntoView({ behavior: still.matches ? "auto" : "smooth" });
}
if (overlay) {
  if (choice) {
    overlay.dataset.query = overlayQuery();
    choice.addEventListener("change", () => { overlay.dataset.query = overlayQuery(); show(overlay); });
    document.querySelector("[data-unzoom]").addEventListener("click", () => { overlay.dataset.query = overlayQuery(); history.replaceState(null, "", "#frfs"); show(overlay); });
  }
  const links = [...document.querySelectorAll("[data-zoom]")];
  links.forEach((link) => link.addEventListener("click", (event) => { event.preventDefault(); zoom(Number(link.dataset.zoom), Number(link.dataset.damping)); }));
  const [, hz] = location.hash.match(/^#frfs=([\d.]+)$/) ?? [];
  if (hz) zoom(Number(hz), Number(links.find((link) => link.dataset.zoom === hz)?.dataset.damping ?? 0.01));
}
/* A cell of the MAC opens that pair of shapes. */
const mac = figures.find((figure) => /\/figures\/mac$/.test(figure.dataset.figure));
const shapes = figures.find((figure) => /\/figures\/shapes$/.test(figure.dataset.figure));
if (mac && shapes) mac.addEventListener("drawn", () => {
  mac.querySelector(".js-plotly-plot").on("plotly_click", ({ points: [cell] }) => {
    const index = (value, given) => (Array.isArray(cell.pointIndex) ? cell.pointIndex[given] : value);
    shapes.dataset.query = new URLSearchParams({ measured: index(cell.y, 0) + 1, model: index(cell.x, 1) + 1 }).toString();
    sight.unobserve(shapes);
    show(shapes);
    shapes.scrollIntoView({ behavior: still.matches ? "auto" : "smooth" });
  });
});

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
  const phase = frf.real.map((re, i) => (Math.atan2(frf.imag[i], re) * 180) / Math.PI);
  const data = [line(magnitude, "y", "magnitude"), line(phase, "y2", "phase")];
  const coherence = frf.coherence !== null;
  if (coherence) data.push(line(frf.coherence, "y3", "coherence"));
  const layout = plain({
    xaxis: { title: { text: "frequency [Hz]" }, anchor: coherence ? "y3" : "y2" },
    yaxis: { type: "log", title: { text: `${table.quantity} [${AFTER[table.quantity]}]` }, domain: coherence ? [0.48, 1] : [0.38, 1], exponentformat: "e" },
    yaxis2: { title: { text: "phase [°]" }, domain: coherence ? [0.2, 0.43] : [0, 0.32], tickvals: [-180, -90, 0, 90, 180], range: [-190, 190] },
    ...(coherence ? { yaxis3: { title: { text: "γ²" }, domain: [0, 0.14], range: [0, 1.05] } } : {}),
  });
  await draw(place, { data, layout });
}
if (select && viewer) {
  const choose = (id) => { select.value = id; history.replaceState(null, "", "#frf=" + id); view(id); };
  select.addEventListener("change", () => choose(select.value));
  for (const point of document.querySelectorAll("[data-point]")) point.addEventListener("click", (event) => {
    event.preventDefault();
    const mine = [...select.options].filter((o) => o.dataset.response === point.dataset.point || o.dataset.reference === point.dataset.point);
    if (!mine.length) return;
    const next = (mine.findIndex((o) => o.value === select.value) + 1) % mine.length;
    choose(mine[next].value);
  });
  const [, named] = location.hash.match(/^#frf=([\w-]+)$/) ?? [];
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
for (const button of document.querySelectorAll("[data-curve]")) button.addEventListener("click", async () => {
  const view = document.querySelector("[data-curve-view]");
  view.hidden = false;
  try { await draw(view.querySelector(".draw"), await get(`coupons/${button.dataset.curve}/curve/figure?theme=${dark.matches ? "dark" : "light"}`)); } catch (error) { view.querySelector(".draw").textContent = error.message; }
  view.scrollIntoView({ behavior: still.matches ? "auto" : "smooth", block: "nearest" });
});
