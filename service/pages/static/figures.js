"use strict";
/* Figures: the service's Plotly JSON drawn in place when it comes into sight, in the colours of the
   page's theme. */

/* Plotly sets a few style attributes as text, which the policy refuses; by the object model the
   same is allowed. */
const setAttribute = Element.prototype.setAttribute;
Element.prototype.setAttribute = function (name, value) {
  if (name === "style") this.style.cssText = value;
  else setAttribute.call(this, name, value);
};

const dark = matchMedia("(prefers-color-scheme: dark)");
const still = matchMedia("(prefers-reduced-motion: reduce)");
const CONFIG = {
  responsive: true,
  displaylogo: false,
  showSendToCloud: false,
  plotlyServerURL: "",
  modeBarButtonsToRemove: ["select2d", "lasso2d"],
};
const withQuery = (path, more) =>
  path + (path.includes("?") ? "&" : "?") + new URLSearchParams(more);

function plain(layout) {
  const line = { linecolor: css("--hint"), zeroline: false };
  const axes = Object.fromEntries(
    Object.entries(layout)
      .filter(([key]) => /^[xy]axis/.test(key))
      .map(([key, value]) => [key, { ...line, ...value }]),
  );
  return {
    font: { family: "system-ui, sans-serif", size: 12, color: css("--text") },
    paper_bgcolor: css("--ground"),
    plot_bgcolor: css("--ground"),
    margin: { l: 70, r: 20, t: 30, b: 60 },
    hovermode: "closest",
    legend: { orientation: "h" },
    ...layout,
    ...axes,
  };
}
const textOf = (markup) => new DOMParser().parseFromString(markup, "text/html").body.textContent;
/* In a narrow place names stand on two lines, and an axis beside many others has two ticks. */
function narrowed(layout) {
  for (const note of layout.annotations ?? [])
    if (note.xref !== "paper")
      Object.assign(note, {
        text: note.text.length > 20 ? note.text.replace(": ", "<br>") : note.text,
        font: { ...note.font, size: 9 },
      });
  const many = Object.keys(layout).filter((key) => /^xaxis/.test(key)).length > 3;
  for (const [key, axis] of Object.entries(layout)) {
    if (!/^[xy]axis/.test(key)) continue;
    if (many) Object.assign(axis, { nticks: 2, tickfont: { size: 9 } });
    if (many && key[0] === "x" && axis.title?.text)
      axis.title = {
        ...axis.title,
        text: axis.title.text.replace(" [", "<br>["),
        font: { size: 9 },
        standoff: 2,
      };
    if (
      key[0] === "x" &&
      axis.ticktext?.length < 7 &&
      axis.ticktext.some((text) => text.includes("<br>"))
    )
      Object.assign(axis, { tickangle: 0, tickfont: { size: 9 } });
    if (key[0] === "y" && axis.ticktext?.some((text) => text.includes("  ")))
      Object.assign(axis, {
        ticktext: axis.ticktext.map((text) => text.replace("  ", "<br>")),
        tickfont: { size: 9 },
      });
  }
}
/* What stands at the cursor where a figure does not say it itself: the values with the words and
   units of their axes. */
function reading(trace, layout) {
  if (trace.hovertemplate || trace.hoverinfo === "skip") return;
  const parts = ["x", "y"].map((way) => {
    const axis = layout[(trace[way + "axis"] ?? way).replace(way, way + "axis")] ?? {};
    const [, words, unit = ""] = /^(.*?)(?: \[(.*)\])?$/.exec(axis.title?.text ?? "");
    const value = axis.type === "date" || axis.ticktext ? `%{${way}}` : `%{${way}:.5g}`;
    return [textOf(words), value, unit].filter(Boolean).join(" ");
  });
  trace.hovertemplate = [trace.name, ...parts].filter(Boolean).join("<br>") + "<extra></extra>";
}
function draw(place, figure) {
  place.replaceChildren();
  place.style.minHeight = figure.layout.height ? 0 : ""; // one that has its height leaves no room below
  const layout = { ...figure.layout, autosize: true };
  delete layout.width;
  const narrow = place.clientWidth < 640;
  layout.font = { ...layout.font, size: narrow ? 11 : 12 };
  layout.legend = {
    ...layout.legend,
    orientation: "h",
    yref: "container",
    yanchor: "bottom",
    y: 0.005,
    x: 0.5,
    xanchor: "center",
  };
  /* The title is the caption, which a reader of the screen finds; in the drawing it would stand
     twice. */
  const caption = place.parentElement.querySelector("figcaption");
  const title = caption
    ? ""
    : ((narrow ? layout.title?.text?.replace(/(.{30,42})\s/g, "$1<br>") : layout.title?.text) ??
      "");
  if (caption && layout.title?.text) caption.textContent = textOf(layout.title.text);
  layout.title = { ...layout.title, text: title, font: { size: narrow ? 12 : 14 } };
  /* In a narrow place a name of the legend takes a line, and a title more than one. */
  const names = figure.data.filter((trace) => trace.showlegend !== false && trace.name).length;
  const below = names ? Math.max(95, 70 + 17 * (narrow ? names : Math.ceil(names / 4))) : 60;
  const above = title ? 50 + 15 * (title.split("<br>").length - 1) : 30;
  layout.margin = { r: 20, ...layout.margin, t: above, b: below };
  if (layout.height) layout.height += below - 95 + above - 50;
  if (narrow) narrowed(layout);
  layout.hoverdistance = -1; // the nearest value, wherever the cursor is
  layout.hoverlabel = {
    bgcolor: css("--ground"),
    bordercolor: css("--line"),
    font: { family: layout.font.family, size: 12, color: css("--text") },
    align: "left",
  };
  for (const trace of figure.data) reading(trace, layout);
  const axes = Object.entries(layout).filter(([key]) => /^[xy]axis/.test(key));
  for (const [, axis] of axes) {
    Object.assign(axis, { gridcolor: css("--line"), tickcolor: css("--line") });
    const power = axis.type === "log" ? { size: 10 } : {}; // which Plotly draws larger
    axis.tickfont = { color: css("--hint"), ...power, ...axis.tickfont };
    if (axis.ticktext) axis.automargin = true;
  }
  if (axes.some(([key, axis]) => key === "yaxis" && axis.ticktext))
    layout.margin.l = narrow ? 30 : 60;
  const across = axes.filter(([key, axis]) => key[0] === "x" && axis.title?.text);
  if (across.length < 4)
    for (const [key, axis] of across)
      layout[key] = { ...axis, title: { ...axis.title, standoff: 8 } };
  return Plotly.newPlot(place, figure.data, layout, CONFIG);
}
const address = (figure) =>
  figure.dataset.query
    ? withQuery(figure.dataset.figure, figure.dataset.query)
    : figure.dataset.figure;
async function show(figure) {
  const place = figure.querySelector(".draw");
  const asked = address(figure);
  sight.unobserve(figure);
  try {
    const found = await get(withQuery(asked, { theme: dark.matches ? "dark" : "light" }));
    if (asked !== address(figure)) return; // something else was chosen in the meantime
    await draw(place, found);
    follow(figure, place, found.layout.meta?.windows);
    performance.mark("drawn " + asked);
    figure.classList.remove("quiet");
    figure.dispatchEvent(new CustomEvent("drawn"));
    files(figure);
  } catch (error) {
    if (asked !== address(figure)) return;
    place.replaceChildren(made("p", { className: "wait" }, error.message));
    figure.classList.add("quiet");
  }
}
/* What comes into view by a zoom is fetched in full: a drawing of the whole has no more points than
   it has pixels. */
function follow(figure, place, windows) {
  if (windows)
    place.on("plotly_relayout", async (moved) => {
      const path = address(figure);
      for (const [axis, [from, to, unit]] of Object.entries(windows)) {
        const range = `${axis[0]}axis${axis.slice(1)}.range`,
          low = moved[`${range}[0]`] ?? moved[range]?.[0],
          high = moved[`${range}[1]`] ?? moved[range]?.[1];
        if (low === undefined) continue;
        const found = await get(
          withQuery(path, {
            [from]: Math.max(0, low * unit),
            [to]: Math.max(0, high * unit),
            theme: dark.matches ? "dark" : "light",
          }),
        ).catch(() => null);
        if (!found || path !== address(figure)) continue; // the drawing of the whole stays
        const on = found.data.flatMap((trace, i) => ((trace.xaxis ?? "x") === axis ? [i] : []));
        await Plotly.restyle(
          place,
          { x: on.map((i) => found.data[i].x), y: on.map((i) => found.data[i].y) },
          on,
        );
        figure.dispatchEvent(new CustomEvent("in-view"));
      }
    });
}
function files(figure) {
  let list = figure.querySelector(".files");
  if (!list) {
    list = made("p", { className: "files" });
    figure.append(list);
  }
  const path = address(figure);
  list.replaceChildren(
    ...["svg", "png", "pdf"].map((format) => {
      const href = rest(withQuery(path, { format }));
      return made("a", { href, download: "" }, format.toUpperCase());
    }),
  );
}
const figures = [...document.querySelectorAll("figure[data-figure]")];
const sight = new IntersectionObserver(
  (entries) =>
    entries.forEach((e) => {
      if (e.isIntersecting) show(e.target);
    }),
  { rootMargin: "300px" },
);
const figureOf = (name) =>
  figures.find((figure) => figure.dataset.figure.endsWith("/figures/" + name));
const goTo = (element, block = "start") =>
  element.scrollIntoView({ behavior: still.matches ? "auto" : "smooth", block });
figures.forEach((figure) => sight.observe(figure));
dark.addEventListener("change", () => location.reload());

/* A figure of which a part is drawn: chosen in a list, named in the address. */
for (const list of document.querySelectorAll("select[data-part-of]")) {
  const figure = figureOf(list.dataset.partOf);
  const key = list.dataset.key;
  const choose = () => {
    figure.dataset.query = list.selectedOptions[0]?.dataset.query ?? "";
  };
  const named = [...list.options].find((option) => option.value === shown.get(key));
  if (named) list.value = named.value;
  choose();
  list.addEventListener("change", () => {
    choose();
    keep({ [key]: list.value });
    show(figure);
  });
}

/* The FRF of a result with the model's interval is the one that the viewer shows. */
const overlay = figureOf("frf");
document.addEventListener("chosen", ({ detail: [first, ...more] }) => {
  if (!overlay || !first || more.length) return;
  overlay.dataset.query = new URLSearchParams({
    point: first.points[0],
    reference: first.points[1],
  }).toString();
  sight.unobserve(overlay); // one that was drawn is drawn anew once it is seen
  sight.observe(overlay);
});
/* The figure of a pair of shapes follows what is chosen; a cell of the MAC chooses. */
const shapes = figureOf("shapes");
hear("mode-chosen", ({ pair: [measured, model] }) => {
  if (!shapes || !measured || !model) return;
  shapes.dataset.query = new URLSearchParams({ measured, model }).toString();
  sight.unobserve(shapes);
  sight.observe(shapes);
});
const mac = figureOf("mac");
mac?.addEventListener("drawn", () =>
  mac.querySelector(".js-plotly-plot").on("plotly_click", ({ points: [cell] }) => {
    const [measured, model] = cell.customdata.map(String);
    tell("choose-mode", { measured, model });
    if (shapes) goTo(shapes, "center");
  }),
);

/* Parameters over time, or of results side by side. */
const UNITS = { Pa: [1e-9, "GPa"], s: [1e6, "µs"], m: [1e3, "mm"] };
for (const box of document.querySelectorAll("[data-over-time]")) {
  const rows = JSON.parse(document.getElementById("over-time").textContent);
  const pick = box.querySelector("select");
  const redraw = () => {
    const name = pick.value;
    const there = rows.filter((row) => row.parameters[name]);
    const [scale, unit] = UNITS[there[0]?.parameters[name].unit] ?? [
      1,
      there[0]?.parameters[name].unit ?? "",
    ];
    const y = there.map((row) => scale * row.parameters[name].value);
    const error = {
      type: "data",
      symmetric: false,
      color: css("--updated"),
      array: there.map((row, i) => scale * row.parameters[name].interval[1] - y[i]),
      arrayminus: there.map((row, i) => y[i] - scale * row.parameters[name].interval[0]),
    };
    const sameDay = new Set(there.map((row) => row.at.slice(0, 10))).size < there.length;
    const x = sameDay ? there.map((row, i) => `${i + 1}: ${row.name}`) : there.map((row) => row.at);
    const data = [
      {
        type: "scatter",
        mode: "markers",
        x,
        y,
        text: there.map((row) => row.name),
        customdata: there.map((row) => row.job),
        error_y: error,
        marker: { color: css("--updated"), size: 9 },
        showlegend: false,
      },
    ];
    const place = box.querySelector(".draw");
    draw(place, {
      data,
      layout: plain({
        xaxis: {
          title: { text: sameDay ? "result" : "performed" },
          ...(sameDay ? { type: "category" } : { type: "date" }),
        },
        yaxis: { title: { text: `${name} [${unit}], 95 % interval` } },
      }),
    }).then(() =>
      place.on("plotly_click", ({ points: [point] }) =>
        location.assign(at("ui/update-jobs/" + point.customdata)),
      ),
    );
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
for (const button of curves)
  button.addEventListener("click", () => {
    keep({ curve: button.dataset.curve });
    showCurve(button.dataset.curve);
  });
if (curves.some((button) => button.dataset.curve === shown.get("curve")))
  showCurve(shown.get("curve"));
