"use strict";
/* The FRF viewer of a page: how the chosen FRFs are shown, and its buttons. All of it stands in the
   address. */
const VIEWS = {
  log: [["log", (q) => `|H| [${q}]`, { decades: true }]],
  db: [["db", (q) => `dB re 1 ${q}`, {}]],
  complex: [
    ["real", (q) => `Re H [${q}]`, {}],
    ["imag", (q) => `Im H [${q}]`, {}],
  ],
  nyquist: [["imag", (q) => `Im H [${q}]`, {}]],
  cmif: [["log", (q) => `σ [${q}]`, { decades: true }]],
};
const MOST_PHASES = 12; // more phases wrap over one another and show nothing
const PHASE = {
  name: "phase",
  title: "phase [°]",
  range: [-190, 190],
  ticks: [-180, 0, 180],
};
const COHERENCE = { name: "coherence", title: "γ²", range: [0, 1.05], ticks: [0, 1] };
const AXIS = 22; // pixels of the numbers below the last panel
const SHARES = { log: 7, db: 7, real: 5, imag: 5, phase: 3, coherence: 2.5 }; // of the pane's height

/* Two numbers of the address, or one; null where it has none. */
function pairOf(key) {
  const pair = (shown.get(key) ?? "").split("~").map(Number);
  return pair.length === 2 && pair[1] > pair[0] ? pair : null;
}
function numberOf(key) {
  const value = Number(shown.get(key));
  return shown.get(key) && Number.isFinite(value) ? value : null;
}

class FrfView {
  constructor(box) {
    this.box = box;
    this.source = JSON.parse(box.querySelector("script[type='application/json']").textContent);
    this.kind = shown.get("v") in VIEWS ? shown.get("v") : "log";
    this.panels = [];
    this.curves = [];
    this.lines = [];
    this.list = new FrfList(this);
    this.zoom = new FrfZoom(this, pairOf("z"));
    this.cursors = new FrfCursors(this, [numberOf("a"), numberOf("b")]);
    this.hooks = {
      key: "frf-" + Math.random(),
      color: css,
      zoom: () => this.zoom.seen,
      zoomed: (low, high) => this.zoom.to(low, high),
      over: (panel, ctx, area) => this.cursors.draw(panel, ctx, area),
    };
  }
  part(name) {
    return this.box.querySelector(`[data-${name}]`) ?? document.querySelector(`[data-${name}]`);
  }
  say(text) {
    this.part("note").textContent = text;
  }
  modes() {
    return this.source.modes.find((set) => set.id === this.part("modes").value)?.modes ?? [];
  }
  get quantity() {
    return this.part("quantity").value || (this.curves[0]?.quantity ?? "accelerance");
  }
  get unit() {
    return FrfData.UNIT[this.quantity].replace(/^(.+\/.+)\/N$/, "($1)/N");
  }

  /* Curves that were read, of rows that were chosen. */
  show(curves, faults, rows) {
    this.curves = curves;
    this.say([...new Set(faults)].join("; ") || (curves.length ? "" : "Choose an FRF."));
    this.build();
    performance.mark("drawn FRFs");
    this.box.dispatchEvent(new CustomEvent("chosen", { bubbles: true, detail: rows }));
  }
  /* The panels of a view, made anew. */
  build() {
    for (const curve of this.curves) {
      curve.pair = FrfData.converted(curve, this.quantity);
      curve.size = null;
    }
    this.zoom.whole = this.curves.length
      ? [
          Math.min(...this.curves.map((c) => c.hz[0])),
          Math.max(...this.curves.map((c) => c.hz.at(-1))),
        ]
      : [0, 1];
    for (const panel of this.panels) panel.destroy();
    const place = this.part("panels");
    place.replaceChildren();
    const kinds = this.kinds();
    this.panels = kinds.map(
      (kind) => new FrfPanel(place, kind, this.height(kind, kinds), this.hooks),
    );
    this.built = [place.clientWidth, place.clientHeight].join();
    this.lines = this.kind === "cmif" ? this.indicator() : null;
    this.panels[0].kind.marked = !this.panels[0].kind.across;
    for (const panel of this.panels) {
      panel.show(
        this.lines ?? this.curves.map((curve) => drawnOf(curve, panel.kind)).filter(Boolean),
      );
      this.zoom.listen(panel);
    }
    this.legend();
    this.cursors.read();
  }
  kinds() {
    const wanted = VIEWS[this.kind].map(([name, title, more]) => ({
      name,
      title: title(this.unit),
      ...more,
    }));
    const apart = this.kind === "nyquist" || this.kind === "cmif";
    if (
      ["log", "db"].includes(this.kind) &&
      this.part("phase").checked &&
      this.curves.length <= MOST_PHASES
    )
      wanted.push({ ...PHASE });
    if (!apart && this.curves.some((c) => c.coherence)) wanted.push({ ...COHERENCE });
    if (this.kind === "nyquist") wanted[0].across = `Re H [${this.unit}]`;
    wanted.at(-1).last = true;
    return wanted;
  }
  height(kind, all) {
    const high = Math.max(160, this.part("panels").clientHeight - AXIS);
    const whole = all.reduce((sum, { name }) => sum + SHARES[name], 0);
    return Math.floor((high * SHARES[kind.name]) / whole) + (kind.last ? AXIS : 0);
  }
  indicator() {
    const measured = this.curves.filter(
      (c) => !c.model && c.hz.length === this.curves[0].hz.length,
    );
    if (!measured.length) return [];
    return FrfData.cmif(
      measured.map((c) => ({
        hz: c.hz,
        ...c.pair,
        response: c.row.response,
        reference: c.row.reference,
      })),
    ).map((values, k) => ({
      x: measured[0].hz,
      y: values.map((v) => (v > 0 ? Math.log10(v) : NaN)),
      color: k ? PALETTE[k % 8] : css("--measured"),
      width: 1.6,
      name: `singular value ${k + 1}`,
    }));
  }
  legend() {
    const named = this.lines ?? this.curves;
    const rows = this.list.chosen();
    this.box.querySelector("h2").textContent =
      rows.length === 1 ? rows[0].name : rows.length ? `${rows.length} FRFs` : "FRFs";
    this.part("legend").replaceChildren(
      ...named.slice(0, MOST_NAMED).map(entryOf),
      named.length > MOST_NAMED ? `and ${named.length - MOST_NAMED} more` : "",
    );
  }

  /* Nothing before the address was read, as it says what is to be chosen. */
  remember() {
    if (!this.list.asked) return;
    const numbers = (values) => values.map((value) => short(value)).join("~");
    const [a, b] = this.cursors.hz;
    const sets = this.part("modes").value;
    keep({
      frf: null,
      hz: null,
      s: this.choice(),
      v: this.kind === "log" ? null : this.kind,
      q: this.part("quantity").value || null,
      z: this.zoom.band && numbers(this.zoom.band),
      a: a === null ? null : short(a),
      b: b === null ? null : short(b),
      m: this.part("model").value || null,
      ms: sets === (this.source.modes.at(-1)?.id ?? "") ? null : sets || "none",
      c:
        this.source.campaigns
          .slice(1)
          .map((c) => c.id)
          .join(",") || null,
    });
  }
  /* What is chosen, in few words where it is all, or all of a reference. */
  choice() {
    const picked = this.list.chosen(),
      { rows } = this.list;
    if (picked.length > 1 && picked.length === rows.length) return "*";
    const { reference } = picked[0] ?? {};
    const whole =
      picked.length > 8 &&
      picked.every((row) => row.reference === reference) &&
      rows.filter((row) => row.reference === reference).length === picked.length;
    return whole ? "ref~" + reference : picked.map((row) => row.key).join(",") || null;
  }
  /* What the address says, or the first FRF of its point; also as earlier versions wrote it, an FRF
     by its id or points, a band by its middle. */
  recall() {
    const said = shown.get("s"),
      old = shown.get("frf");
    const [middle, half] = (shown.get("hz") ?? "").split("~").map(Number);
    if (middle && half) this.zoom.band = [Math.max(0, middle - half), middle + half];
    if (said === "*") return () => true;
    if (said?.startsWith("ref~")) return (row) => row.reference === said.slice(4);
    if (said) {
      const keys = said.split(",");
      return (row) => keys.includes(row.key);
    }
    const { rows } = this.list,
      point = Number(shown.get("point"));
    const first =
      rows.find(
        (row) =>
          old && (row.id === old || row.points.join("~") === old || String(row.points[0]) === old),
      ) ??
      rows.find((row) => row.points.includes(point)) ??
      rows[0];
    return (row) => row === first;
  }

  /* What the buttons and keys do. */
  acts() {
    const { zoom, cursors } = this;
    /* What is copied is what was chosen, also where it is still being read. */
    const give = async (name, kind, content) => {
      this.say("Copying …");
      await this.list.shown;
      await handOver(name, kind, await content(), (text) => this.say(text));
    };
    return {
      whole: () => zoom.to(...zoom.whole),
      closer: () => zoom.by(0.6),
      wider: () => zoom.by(1 / 0.6),
      before: () => cursors.step(-1, true),
      next: () => cursors.step(1, true),
      clear: () => cursors.clear(),
      csv: () =>
        give("csv", "text/csv", () =>
          this.lines
            ? tableOfIndicator(this.lines, zoom.seen)
            : tableOfCurves(this.curves, this.quantity, zoom.seen),
        ),
      png: () => give("png", "image/png", () => pictureOf(this.panels, css("--ground"))),
      svg: () =>
        give("svg", "image/svg+xml", () =>
          drawingOf(this.panels, {
            text: css("--text"),
            line: css("--hint"),
            ground: css("--ground"),
          }),
        ),
    };
  }
  listen() {
    const acts = this.acts();
    this.box.addEventListener("click", (event) => {
      const does = event.target.closest("button")?.dataset.do;
      if (does) acts[does]?.();
    });
    const buttons = [...this.box.querySelectorAll("[data-cursor]")];
    for (const button of buttons)
      button.addEventListener("click", () => {
        this.cursors.active = Number(button.dataset.cursor);
        for (const other of buttons) other.setAttribute("aria-pressed", String(other === button));
      });
    this.part("panels").addEventListener("keydown", (event) => this.key(event, acts));
    hear("point-chosen", ({ point, more }) => this.list.choosePoint(Number(point), more));
    hear("mode-chosen", ({ hz }) => {
      this.mode = hz;
      const [low, high] = this.zoom.seen;
      if (this.zoom.band && (hz < low || hz > high)) {
        const half = (high - low) / 2;
        this.zoom.to(hz - half, hz + half);
      }
      this.panels.forEach((panel) => panel.redraw());
    });
    document.addEventListener("zoom-frfs", ({ detail: { low, high, moving } }) => {
      if (this.curves.length) this.zoom.to(low, high, moving);
      else {
        this.zoom.band = [low, high];
        this.remember();
      } // the FRFs are still to be read
    });
    new ResizeObserver(() => {
      const { clientWidth, clientHeight } = this.part("panels");
      if (this.panels.length && clientWidth && this.built !== [clientWidth, clientHeight].join())
        this.build();
    }).observe(this.part("panels"));
    this.listenToLists();
  }
  key(event, acts) {
    const { zoom, cursors } = this;
    const does = {
      ArrowLeft: () => (event.shiftKey ? zoom.shift(-0.2) : cursors.step(-1)),
      ArrowRight: () => (event.shiftKey ? zoom.shift(0.2) : cursors.step(1)),
      PageUp: acts.before,
      PageDown: acts.next,
      "+": acts.closer,
      "-": acts.wider,
      0: acts.whole,
    }[event.key];
    if (does) {
      event.preventDefault();
      does();
    }
  }
  listenToLists() {
    const on = (name, act) => this.part(name)?.addEventListener("change", act);
    const anew = () => {
      this.remember();
      this.build();
    };
    this.part("frfs").addEventListener("picked", () => this.list.load());
    on("all", () => {
      const which = this.part("all").value;
      if (which)
        this.list.choose(
          (row) => which === "*" || row.reference === which || "r" + row.response === which,
        );
    });
    on("view", () => {
      this.kind = this.part("view").value;
      anew();
    });
    on("quantity", anew);
    on("phase", () => this.build());
    on("model", () => this.list.load());
    on("modes", () => {
      this.panels.forEach((panel) => panel.redraw());
      this.remember();
    });
    on("other", async () => {
      try {
        await this.list.addCampaign(this.part("other").value);
        this.part("frfs").focus();
      } catch (error) {
        this.say(error.message);
      }
      this.part("other").value = "";
    });
  }

  /* Lists are filled as the address says; what is chosen is read when the viewer comes into sight.
   */
  open() {
    const { source } = this;
    source.modes.forEach((set) => this.part("modes").append(new Option(set.name, set.id)));
    this.part("modes").value =
      shown.get("ms") === "none" ? "" : (shown.get("ms") ?? source.modes.at(-1)?.id ?? "");
    source.jobs.forEach(([id, name]) => this.part("model").append(new Option(name, id)));
    this.part("model").value = shown.get("m") ?? (source.job || "");
    this.part("view").value = this.kind;
    this.part("quantity").value = shown.get("q") ?? "";
    this.list.add(source.campaigns[0], true);
    this.listen();
    const others = (shown.get("c") ?? "").split(",").filter(Boolean);
    const once = new IntersectionObserver(
      async (entries) => {
        if (!entries.some((e) => e.isIntersecting)) return;
        once.disconnect();
        for (const id of others)
          await this.list.addCampaign(id).catch((error) => this.say(error.message));
        this.list.choose(this.recall());
      },
      { rootMargin: "300px" },
    );
    once.observe(this.box);
  }
}
function entryOf({ color, dash, name }) {
  const sign = made("i");
  sign.style.borderTop = `3px ${dash ? (dash[0] < 4 ? "dotted" : "dashed") : "solid"} ${color}`;
  return made("span", {}, sign, name);
}
/* What a panel draws of a curve; nothing of one without coherence. */
function drawnOf(curve, kind) {
  const look = { color: curve.color, width: curve.width, dash: curve.dash, model: curve.model };
  if (kind.name === "coherence")
    return curve.coherence && { ...look, x: curve.hz, y: curve.coherence };
  const y = FrfData.part(curve.pair, kind.name);
  return kind.across
    ? { ...look, x: FrfData.part(curve.pair, "real"), y, hz: curve.hz }
    : { ...look, x: curve.hz, y, wraps: kind.name === "phase" };
}
for (const box of document.querySelectorAll("[data-frf-viewer]")) new FrfView(box).open();
