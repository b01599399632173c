"use strict";
/* Two cursors on the lines of the first curve: where they stand, what is read there, and how they
   and the modes are drawn. */
const MOST_NAMED = 12; // curves in a legend and a table
const short = (value, digits = 7) => String(Number(value.toPrecision(digits)));
const rounded = (value, digits) =>
  Math.abs(value) >= 10 ** digits && Math.abs(value) < 1e7
    ? value.toFixed(0)
    : value.toPrecision(digits);
const sizeOf = (curve) =>
  (curve.size ??= curve.pair.re.map((re, i) => Math.hypot(re, curve.pair.im[i])));

class FrfCursors {
  /* `hz`: of A and B, null where there is none. */
  constructor(view, hz) {
    this.view = view;
    this.hz = hz;
    this.active = 0;
  }
  get lead() {
    return this.view.curves[0];
  }

  to(hz, which = this.active) {
    if (!this.lead) return;
    this.hz[which] = this.lead.hz[FrfData.nearest(this.lead.hz, hz)];
    const [low, high] = this.view.zoom.seen;
    if (hz < low || hz > high) this.view.zoom.to(hz - (high - low) / 2, hz + (high - low) / 2);
    this.changed();
  }
  clear() {
    this.hz = [null, null];
    this.changed();
  }
  changed() {
    this.view.panels.forEach((panel) => panel.redraw());
    this.view.remember();
    this.read();
  }
  /* By a line, or to the next peak in a direction. */
  step(way, peak) {
    if (!this.lead) return;
    const { hz } = this.lead;
    const [low, high] = this.view.zoom.seen;
    const from = FrfData.nearest(hz, this.hz[this.active] ?? (way > 0 ? low : high));
    const to = peak
      ? FrfData.nextPeak(sizeOf(this.lead), from, way)
      : Math.min(hz.length - 1, Math.max(0, from + way));
    this.view.say(to === null ? "No further peak." : "");
    if (to !== null) this.to(hz[to]);
  }

  /* Values at the cursors as a table. */
  read() {
    const table = this.view.part("readings"),
      [a, b] = this.hz;
    table.hidden = (a === null && b === null) || !this.lead;
    if (table.hidden) return;
    const places = Math.max(0, -Math.floor(Math.log10(this.lead.hz[1] - this.lead.hz[0] || 1)));
    const hz = (value) => (value === null ? "–" : value.toFixed(places));
    const heads = [
      "FRF",
      `A: ${hz(a)} Hz [${this.view.unit}]`,
      "phase",
      `B: ${hz(b)} Hz [${this.view.unit}]`,
      "phase",
      `B − A: ${a !== null && b !== null ? hz(b - a) : "–"} Hz`,
      "ζ at A, half power",
    ];
    const made = (tag, text) => {
      const cell = document.createElement(tag);
      cell.textContent = text;
      if (tag === "td") cell.className = "num";
      return cell;
    };
    const row = (cells) => {
      const line = document.createElement("tr");
      line.append(...cells.map((text, k) => made(k ? "td" : "th", text)));
      return line;
    };
    table.querySelector("thead tr").replaceChildren(...heads.map((text) => made("th", text)));
    table
      .querySelector("tbody")
      .replaceChildren(
        ...this.view.curves.slice(0, MOST_NAMED).map((curve) => row(this.readings(curve, hz))),
      );
  }
  readings(curve, hz) {
    const [a, b] = this.hz;
    const at = (f) => sizeOf(curve)[FrfData.nearest(curve.hz, f)];
    const apart =
      a === null || b === null ? "–" : `${(20 * Math.log10(at(b) / at(a))).toFixed(2)} dB`;
    return [curve.name, ...valueAt(curve, a), ...valueAt(curve, b), apart, dampingAt(curve, a, hz)];
  }

  /* Modes and cursors over a panel. */
  draw(panel, ctx, area) {
    const [low, high] = this.view.zoom.seen;
    const at = (hz) => area.left + ((hz - low) / (high - low)) * area.width;
    ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
    if (!panel.kind.across) this.drawModes(panel, ctx, area, at);
    this.hz.forEach((hz, k) => {
      if (hz !== null) this.drawCursor(panel, ctx, area, { hz, k, x: at(hz) });
    });
  }
  drawModes(panel, ctx, area, at) {
    const [low, high] = this.view.zoom.seen;
    let left = -Infinity;
    for (const [number, hz, ratio] of this.view.modes()) {
      if (hz < low || hz > high) continue;
      upright(ctx, at(hz), area, css("--hint"), [2, 4]);
      if (panel !== this.view.panels[0] || at(hz) - left <= 14 * devicePixelRatio) continue;
      left = at(hz);
      label(
        ctx,
        left,
        area.top,
        `${number}${ratio === null ? "" : `: ζ ${short(100 * ratio, 3)} %`}`,
      );
    }
  }
  drawCursor(panel, ctx, area, { hz, k, x }) {
    ctx.fillStyle = css(k ? "--initial" : "--updated");
    if (panel.kind.across)
      for (const curve of panel.curves) dot(ctx, panel.plot, curve, FrfData.nearest(curve.hz, hz));
    else {
      upright(ctx, x, area, ctx.fillStyle, []);
      if (panel === this.view.panels[0]) ctx.fillText("AB"[k], x + 4, area.top + area.height - 6);
    }
  }
}

/* Magnitude and phase at a frequency: as many digits as the lines and the random error leave. */
function valueAt(curve, f) {
  if (f === null) return ["–", "–"];
  const i = FrfData.nearest(curve.hz, f),
    size = sizeOf(curve)[i];
  const error = FrfData.randomError(curve.coherence?.[i], curve.row.averages);
  const digits = error ? Math.min(6, Math.max(2, 2 - Math.floor(Math.log10(error)))) : 4;
  const phase = FrfData.part({ re: [curve.pair.re[i]], im: [curve.pair.im[i]] }, "phase")[0];
  return [
    `${rounded(size, digits)}${error ? ` ± ${rounded(error * size, 2)}` : ""}`,
    `${phase.toFixed(1)}°`,
  ];
}
function dampingAt(curve, f, hz) {
  const width =
    f === null ? null : FrfData.halfPower(curve.hz, sizeOf(curve), FrfData.nearest(curve.hz, f));
  if (!width) return "–";
  return `${short(100 * width.ratio, width.lines < 10 ? 2 : 3)} % at ${hz(width.hz)} Hz${width.lines < 4 ? `, of ${width.lines.toFixed(1)} lines only` : ""}`;
}
/* A name of a mode along its line, on a ground of its own so that curves do not cross it. */
function label(ctx, x, top, text) {
  const k = devicePixelRatio;
  ctx.save();
  ctx.translate(x, top + 3 * k);
  ctx.rotate(-Math.PI / 2);
  ctx.textAlign = "right";
  ctx.fillStyle = css("--ground");
  ctx.globalAlpha = 0.8;
  ctx.fillRect(
    -ctx.measureText(text).width - 2 * k,
    -13 * k,
    ctx.measureText(text).width + 4 * k,
    12 * k,
  );
  ctx.globalAlpha = 1;
  ctx.fillStyle = css("--text");
  ctx.fillText(text, 0, -3 * k);
  ctx.restore();
}
function upright(ctx, x, area, color, dash) {
  ctx.beginPath();
  ctx.strokeStyle = color;
  ctx.lineWidth = devicePixelRatio;
  ctx.setLineDash(dash);
  ctx.moveTo(x, area.top);
  ctx.lineTo(x, area.top + area.height);
  ctx.stroke();
  ctx.setLineDash([]);
}
function dot(ctx, plot, curve, i) {
  ctx.beginPath();
  ctx.arc(
    plot.valToPos(curve.x[i], "x", true),
    plot.valToPos(curve.y[i], "y", true),
    5 * devicePixelRatio,
    0,
    7,
  );
  ctx.fill();
}
