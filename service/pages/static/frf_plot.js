"use strict";
/* A panel of curves on one axis of frequency: uPlot draws axes, grid and pointer, we the curves,
   thinned to the least and the greatest value of each column of pixels, so that no peak is lost.
   Many curves are moved as a picture of three times the width, which is drawn a few curves a frame,
   and drawn sharply when the movement rests. */
const MANY = 24; // curves from which they are moved as a picture
const SHARE_MS = 8; // of a frame that drawing this picture may take
class FrfPanel {
  /* `kind`: title, and unit or log; `range` of y where it is fixed. */
  constructor(place, kind, height, hooks) {
    this.kind = kind;
    this.curves = [];
    this.y = kind.range ?? [0, 1];
    this.hooks = hooks;
    const axis = {
      stroke: hooks.color("--hint"),
      grid: { stroke: hooks.color("--line"), width: 1 },
      ticks: { stroke: hooks.color("--line"), width: 1 },
      font: "12px system-ui, sans-serif",
    };
    const decade = (v) => (Number.isInteger(v) ? (v === 0 ? "1" : v === 1 ? "10" : "10" + raised(v)) : "");
    this.plot = new uPlot(
      {
        width: place.clientWidth,
        height,
        legend: { show: false },
        padding: [8, 26, 0, 0],
        cursor: {
          y: false,
          points: { show: false },
          drag: { setScale: false, x: true, y: false },
          sync: { key: hooks.key, setSeries: false },
        },
        scales: {
          x: {
            time: false,
            auto: false,
            range: () => (kind.across ? (this.x ?? [0, 1]) : hooks.zoom()),
          },
          y: { auto: false, range: () => this.y },
        },
        series: [{}, { show: true, paths: () => null, points: { show: false } }],
        axes: [
          {
            ...axis,
            size: kind.last ? 44 : 22,
            label: kind.last ? (kind.across ?? "frequency [Hz]") : undefined,
            labelSize: 18,
            labelFont: "12px system-ui, sans-serif",
            values: (_, ticks) => ticks.map((v) => (kind.last ? tickOf(v) : "")),
          },
          {
            ...axis,
            size: 62,
            label: kind.title,
            labelSize: 18,
            labelFont: "12px system-ui, sans-serif",
            ...(kind.decades
              ? { values: (_, ticks) => ticks.map(decade), incrs: [1, 2, 3, 5] }
              : { values: (_, ticks) => ticks.map(tickOf) }),
            ...(kind.ticks ? { splits: () => kind.ticks } : {}),
          },
        ],
        hooks: {
          draw: [() => this.paint()],
          setSelect: [
            (u) => {
              if (u.select.width > 4 && !kind.across)
                hooks.zoomed(
                  u.posToVal(u.select.left, "x"),
                  u.posToVal(u.select.left + u.select.width, "x"),
                );
              u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
            },
          ],
        },
      },
      [
        [0, 1],
        [0, 1],
      ],
      place,
    );
  }
  /* Curves are {x, y, color, width, dash}; x and y of one length. */
  show(curves) {
    this.curves = curves;
    this.fit();
  }
  fit() {
    const [low, high] = this.hooks.zoom();
    let [least, most, left, right] = [Infinity, -Infinity, Infinity, -Infinity];
    const hard = this.curves.filter((curve) => !curve.model); // a model may fall far below the noise of what was measured
    for (const { x, y, hz = x } of hard.length ? hard : this.curves)
      for (let i = 0; i < y.length; i += 1)
        if (hz[i] >= low && hz[i] <= high) {
          if (y[i] < least) least = y[i];
          if (y[i] > most) most = y[i];
          if (x[i] < left) left = x[i];
          if (x[i] > right) right = x[i];
        }
    if (most >= least && !this.kind.range) {
      const room = 0.08 * (most - least) || 0.1 * Math.abs(most) || 1;
      this.y = [least - room, most + (this.kind.marked ? 3.5 : 1) * room];
    } // names of modes stand above
    if (this.kind.across && right >= left) this.square(left, right);
    this.layer = this.coming = null;
    this.redraw();
  }
  /* The same scale across as up: a mode of a Nyquist diagram is a circle. */
  square(left, right) {
    const [w, h] = [this.plot.bbox.width, this.plot.bbox.height];
    const half = Math.max((right - left) / w, (this.y[1] - this.y[0]) / h) * 0.55;
    const [cx, cy] = [(left + right) / 2, (this.y[0] + this.y[1]) / 2];
    this.x = [cx - half * w, cx + half * w];
    this.y = [cy - half * h, cy + half * h];
  }
  /* `moving`: the scale of y stays, and many curves are shown as the picture that there is of them.
   */
  redraw(moving = false) {
    const [low, high] = this.kind.across ? (this.x ?? [0, 1]) : this.hooks.zoom();
    this.moving = moving && this.curves.length > MANY && !this.kind.across;
    this.plot.batch(() => {
      this.plot.setScale("x", { min: low, max: high });
      this.plot.setScale("y", { min: this.y[0], max: this.y[1] });
    });
    if (this.curves.length > MANY && !this.kind.across) this.prepare(low, high);
  }
  paint() {
    const { ctx, bbox } = this.plot;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    if (this.moving && this.layer) this.shift(ctx, bbox);
    else for (const curve of this.curves) this.stroke(curve, ctx, bbox);
    ctx.setLineDash([]);
    this.hooks.over(this, ctx, bbox);
    ctx.restore();
  }
  stroke(curve, ctx, box, range) {
    ctx.beginPath();
    ctx.strokeStyle = curve.color;
    ctx.lineWidth = (curve.width ?? 1.3) * devicePixelRatio;
    ctx.setLineDash((curve.dash ?? []).map((d) => d * devicePixelRatio));
    this.trace(curve, ctx, box, range);
    ctx.stroke();
  }
  shift(ctx, box) {
    const { min, max } = this.plot.scales.x;
    const across = box.width / (max - min);
    const { canvas, range } = this.layer;
    ctx.drawImage(
      canvas,
      box.left + (range[0] - min) * across,
      box.top,
      (range[1] - range[0]) * across,
      box.height,
    );
  }
  /* Begin the picture of three times what is seen, where the one that there is does not reach far
     enough; draw a part of it. */
  prepare(low, high) {
    const wide = high - low,
      { bbox } = this.plot;
    const fits = (one) =>
      one &&
      Math.abs(Math.log(wide / one.wide)) < 0.7 &&
      low - one.range[0] > 0.3 * wide &&
      one.range[1] - high > 0.3 * wide;
    if (!fits(this.layer) && !fits(this.coming)) {
      const canvas = made("canvas", { width: 3 * bbox.width, height: bbox.height });
      this.coming = { canvas, wide, range: [low - wide, high + wide], next: 0 };
    }
    if (this.coming) this.work();
  }
  work() {
    const { canvas, range } = this.coming,
      began = performance.now();
    const box = { left: 0, top: 0, width: canvas.width, height: canvas.height };
    const pen = canvas.getContext("2d");
    while (this.coming.next < this.curves.length && performance.now() - began < SHARE_MS / 2)
      this.stroke(this.curves[this.coming.next++], pen, box, range);
    if (this.coming.next >= this.curves.length) {
      this.layer = this.coming;
      this.coming = null;
    } else if (!this.working) {
      this.working = requestAnimationFrame(() => {
        this.working = 0;
        if (this.coming) this.work();
      });
    }
  }
  /* The line of a curve into a pen with moveTo and lineTo, in pixels of `box`. */
  trace(curve, pen, box, [min, max] = [this.plot.scales.x.min, this.plot.scales.x.max]) {
    const [x, y] = [curve.x, curve.y];
    const across = box.width / (max - min);
    const up = box.height / (this.y[1] - this.y[0]);
    const below = box.top + box.height + this.y[0] * up;
    if (this.kind.across)
      return trail(
        curve,
        pen,
        (v) => box.left + (v - min) * across,
        (v) => below - v * up,
        this.hooks.zoom(),
      );
    const first = Math.max(0, FrfData.nearest(x, min) - 1);
    const last = Math.min(x.length - 1, FrfData.nearest(x, max) + 1);
    const wide = this.curves.length > MANY ? 2 : 1; // pixels of a column
    let [column, least, most, open] = [-1, 0, 0, false];
    const close = () => {
      if (open && least !== most) {
        pen.lineTo(column * wide, least);
        pen.lineTo(column * wide, most);
      }
    };
    for (let i = first; i <= last; i += 1) {
      const v = y[i];
      if (v !== v) {
        close();
        open = false;
        column = -1;
        continue;
      }
      const px = box.left + (x[i] - min) * across;
      const c = (px / wide) | 0;
      const py = below - v * up;
      if (c !== column || !open) {
        close();
        if (open && !(curve.wraps && Math.abs(v - y[i - 1]) > 180)) pen.lineTo(px, py);
        else pen.moveTo(px, py);
        [column, least, most, open] = [c, py, py, true];
      } else if (py < least) least = py;
      else if (py > most) most = py;
    }
    close();
  }
  destroy() {
    this.plot.destroy();
  }
}
/* A number of an axis as print has it: 10², −180, 2·10⁻⁵. */
const RAISED = "⁻⁰¹²³⁴⁵⁶⁷⁸⁹";
const raised = (n) => String(n).replace(/./g, (c) => RAISED["-0123456789".indexOf(c)]);
function tickOf(value) {
  const [digits, power] = value.toExponential().split("e");
  const far = Math.abs(power) > 4 && value !== 0;
  const text = far ? `${short(Number(digits), 3)}·10${raised(Number(power))}` : short(value, 6);
  return text.replace(/^-/, "−");
}
/* A curve in a plane, such as a Nyquist diagram, over the lines of a band. */
function trail({ x, y, hz }, pen, across, up, [low, high]) {
  let open = false;
  for (let i = 0; i < x.length; i += 1) {
    if (!(hz[i] >= low && hz[i] <= high) || x[i] !== x[i] || y[i] !== y[i]) {
      open = false;
      continue;
    }
    if (open) pen.lineTo(across(x[i]), up(y[i]));
    else pen.moveTo(across(x[i]), up(y[i]));
    open = true;
  }
}

/* The panels as they are seen, as one picture. */
function pictureOf(panels, ground) {
  const sheets = panels.map((panel) => panel.plot.ctx.canvas);
  const height = sheets.reduce((all, sheet) => all + sheet.height, 0);
  const canvas = made("canvas", { width: sheets[0].width, height });
  const pen = canvas.getContext("2d");
  pen.fillStyle = ground;
  pen.fillRect(0, 0, canvas.width, canvas.height);
  sheets.reduce((top, sheet) => {
    pen.drawImage(sheet, 0, top);
    return top + sheet.height;
  }, 0);
  return new Promise((done) => canvas.toBlob(done, "image/png"));
}
/* The same as lines and texts, for a document. */
function drawingOf(panels, look) {
  const safe = (text) =>
    String(text).replace(/[&<>]/g, (c) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;" })[c]);
  const word = (x, y, text, anchor = "middle", more = "") =>
    `<text x="${x.toFixed(1)}" y="${y.toFixed(1)}" text-anchor="${anchor}"${more}>${safe(text)}</text>`;
  let [top, parts, width] = [0, [], 0];
  for (const panel of panels) {
    const { plot } = panel;
    const k = devicePixelRatio;
    const box = {
      left: plot.bbox.left / k,
      top: top + plot.bbox.top / k,
      width: plot.bbox.width / k,
      height: plot.bbox.height / k,
    };
    width = plot.width;
    parts.push(
      `<rect x="${box.left}" y="${box.top}" width="${box.width}" height="${box.height}" fill="none" stroke="${look.line}"/>`,
    );
    plot.axes.forEach((axis, i) =>
      (axis._splits ?? []).forEach((value, n) => {
        const at = plot.valToPos(value, i ? "y" : "x");
        parts.push(
          i
            ? word(box.left - 6, box.top + at + 4, axis._values[n] ?? "", "end")
            : word(box.left + at, box.top + box.height + 15, axis._values[n] ?? ""),
        );
      }),
    );
    parts.push(
      word(
        14,
        box.top + box.height / 2,
        panel.kind.title,
        "middle",
        ` transform="rotate(-90 14 ${box.top + box.height / 2})"`,
      ),
    );
    if (panel.kind.last)
      parts.push(
        word(
          box.left + box.width / 2,
          box.top + box.height + 34,
          panel.kind.across ?? "frequency [Hz]",
        ),
      );
    for (const curve of panel.curves) {
      const d = [];
      panel.trace(
        curve,
        {
          moveTo: (x, y) => d.push(`M${x.toFixed(1)} ${y.toFixed(1)}`),
          lineTo: (x, y) => d.push(`L${x.toFixed(1)} ${y.toFixed(1)}`),
        },
        box,
      );
      parts.push(
        `<svg x="${box.left}" y="${box.top}" width="${box.width}" height="${box.height}" viewBox="${box.left} ${box.top} ${box.width} ${box.height}"><path d="${d.join("")}" fill="none" stroke="${curve.color}" stroke-width="${curve.width ?? 1.3}"${curve.dash ? ` stroke-dasharray="${curve.dash.join(" ")}"` : ""}/></svg>`,
      );
    }
    top += plot.height;
  }
  return `<svg xmlns="http://www.w3.org/2000/svg" width="${width}" height="${top}" viewBox="0 0 ${width} ${top}" font-family="system-ui, sans-serif" font-size="12" fill="${look.text}"><rect width="100%" height="100%" fill="${look.ground}"/>${parts.join("")}</svg>`;
}
