"use strict";
/* Two cursors on the lines of the first curve: where they stand, what is read there, and how they
   and the modes are drawn. */
const MOST_NAMED = 12; // curves in a legend and a table
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
    const row = (curve) => {
      const [name, ...values] = this.readings(curve, hz);
      const cells = values.map((text) => made("td", { className: "num" }, text));
      return made("tr", {}, made("th", {}, name), ...cells);
    };
    table.querySelector("thead tr").replaceChildren(...heads.map((text) => made("th", {}, text)));
    const curves = this.view.curves.slice(0, MOST_NAMED);
    table.querySelector("tbody").replaceChildren(...curves.map(row));
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
  /* A line and a number at each mode; the one that is chosen says what it is. */
  drawModes(panel, ctx, area, at) {
    const [low, high] = this.view.zoom.seen;
    const first = panel === this.view.panels[0];
    const modes = this.view.modes().filter(([, hz]) => hz >= low && hz <= high);
    const chosen = ([, hz]) => Math.abs(hz / this.view.mode - 1) < 1e-9;
    this.tags = first ? [] : this.tags;
    for (const mode of modes) {
      const [, hz] = mode;
      const look = chosen(mode) ? [css("--act"), []] : [css("--hint"), [2, 4]];
      upright(ctx, at(hz), area, ...look);
    }
    if (first)
      for (const mode of modes.sort((a, b) => chosen(b) - chosen(a) || a[1] - b[1]))
        this.tag(ctx, at(mode[1]), area, mode, chosen(mode));
  }
  tag(ctx, x, area, [number, hz, ratio], isChosen) {
    const k = devicePixelRatio;
    const damping = ratio === null ? "" : ` · ζ ${short(100 * ratio, 3)} %`;
    const text = isChosen ? `${number} · ${short(hz, 5)} Hz${damping}` : String(number);
    const wide = ctx.measureText(text).width + 8 * k;
    const left = Math.min(Math.max(x - wide / 2, area.left), area.left + area.width - wide);
    if (this.tags.some((other) => left < other.right && left + wide > other.left)) return;
    this.tags.push({ left, right: left + wide, number });
    ctx.textAlign = "left";
    ctx.textBaseline = "alphabetic";
    ctx.fillStyle = css(isChosen ? "--act" : "--card");
    ctx.fillRect(left, area.top + 2 * k, wide, 16 * k);
    ctx.fillStyle = css(isChosen ? "--on-act" : "--text");
    ctx.fillText(text, left + 4 * k, area.top + 14 * k);
  }
  /* The mode whose number stands at a place of the first panel, in pixels from its corner. */
  modeAt(x, y, panel) {
    const k = devicePixelRatio;
    const from = x * k + panel.plot.bbox.left;
    return y > 20 ? null : this.tags?.find(({ left, right }) => from >= left && from <= right);
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
