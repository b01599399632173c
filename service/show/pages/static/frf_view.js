"use strict";
/* The FRF viewer of a page: which FRFs are chosen, how they are shown, two cursors, modes, zoom. All of it stands in the address. */
const SIGNED = (direction) => (direction > 0 ? "+" : "−") + ["", "x", "y", "z", "rx", "ry", "rz"][Math.abs(direction)];
const PALETTE = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8a6d3b", "#7a5fb5"];
const VIEWS = {
  log: [["log", (q) => `|H| [${q}]`, { decades: true }]],
  db: [["db", (q) => `dB re 1 ${q}`, {}]],
  complex: [["real", (q) => `Re H [${q}]`, {}], ["imag", (q) => `Im H [${q}]`, {}]],
  nyquist: [["imag", (q) => `Im H [${q}]`, {}]],
  cmif: [["log", (q) => `σ [${q}]`, { decades: true }]],
};
const MOST_PHASES = 12; // more phases wrap over one another and show nothing
const MOST_NAMED = 12;
const PHASE = ["phase", () => "phase [°]", { range: [-190, 190], ticks: [-180, -90, 0, 90, 180] }];

function openViewer(box) {
  const source = JSON.parse(box.querySelector("script[type='application/json']").textContent);
  const part = (name) => box.querySelector(`[data-${name}]`);
  const list = part("frfs"), place = part("panels"), note = part("note");
  const state = { view: shown.get("v") ?? "log", quantity: shown.get("q") ?? "", zoom: pairOf("z"), cursors: [numberOf("a"), numberOf("b")], active: 0 };
  const rows = [], loaded = new Map();
  let panels = [], curves = [], lines = [], asked = 0, whole = [0, 1], pending = 0;

  function pairOf(key) { const pair = (shown.get(key) ?? "").split("~").map(Number); return pair.length === 2 && pair[1] > pair[0] ? pair : null; }
  function numberOf(key) { const value = Number(shown.get(key)); return shown.get(key) && Number.isFinite(value) ? value : null; }
  const short = (value, digits = 7) => String(Number(value.toPrecision(digits)));
  const rounded = (value, digits) => (Math.abs(value) >= 10 ** digits && Math.abs(value) < 1e7 ? value.toFixed(0) : value.toPrecision(digits));

  /* Which FRFs there are. Names are those of places, so that an address says the same after another import. */
  function add(campaign, first = false) {
    for (const [id, response, rd, reference, fd, quantity, label, averages] of campaign.frfs) {
      const dof = `${response}${SIGNED(rd)}/${reference}${SIGNED(fd)}`;
      const base = `${campaign.id.slice(-6)}~${response}.${rd}~${reference}.${fd}`;
      const same = rows.filter((row) => row.base === base).length;
      const row = { id, base, key: (first ? base.slice(7) : base) + (same ? `~${same + 1}` : ""), campaign, response: `${response}${SIGNED(rd)}`, reference: `${reference}${SIGNED(fd)}`, points: [response, reference], dofs: [response, rd, reference], quantity, averages, name: (source.campaigns.length > 1 ? `${campaign.name}: ` : "") + dof };
      row.option = new Option(`${dof} · ${quantity}${label ? ` · ${label}` : ""}${first ? "" : ` · ${campaign.name}`}`, row.key);
      rows.push(row);
      list.append(row.option);
    }
    const references = [...new Set(rows.map((row) => row.reference))];
    part("all").replaceChildren(new Option("choose …", ""), new Option("all", "*"), ...references.map((r) => new Option(`all of reference ${r}`, r)), ...[...new Set(rows.map((row) => row.response))].slice(0, 300).map((r) => new Option(`all of response ${r}`, "r" + r)));
  }
  const chosen = () => rows.filter((row) => row.option.selected);
  function choose(test) {
    for (const row of rows) row.option.selected = test(row);
    part("all").value = "";
    load();
  }

  async function frfAt(path) {
    if (!loaded.has(path)) loaded.set(path, (async () => {
      const answer = await fetch(new URL(document.documentElement.dataset.root + "api/v1/" + path, location.href), { credentials: "same-origin", headers: { Accept: "application/x-npz" } });
      if (!answer.ok) throw new Error((await answer.json()).detail);
      return FrfData.curveOf(await answer.arrayBuffer());
    })().catch((error) => { loaded.delete(path); throw error; }));
    return loaded.get(path);
  }
  /* Six at a time, as a browser asks a host at once; what was chosen in the meantime wins. */
  async function load() {
    const mine = ++asked;
    const rowsNow = chosen();
    remember();
    const job = part("model").value;
    const wanted = rowsNow.flatMap((row, i) => {
      const color = rowsNow.length === 1 ? css("--measured") : PALETTE[i % PALETTE.length];
      const own = [{ row, name: row.name, path: `frfs/${row.id}/data?format=npz`, color, width: rowsNow.length > 8 ? 1 : 1.6 }];
      if (job && row.campaign === source.campaigns[0]) for (const [model, dash, alone] of [["initial", [2, 3], "--initial"], ["updated", [7, 4], "--updated"]]) {
        if (model === "initial" && rowsNow.length > 1) continue;
        own.push({ row, model, name: `${row.name}, ${model}`, path: `update-jobs/${job}/frfs/data?format=npz&model=${model}&point=${row.dofs[0]}&direction=${row.dofs[1]}&reference=${row.dofs[2]}`, color: rowsNow.length === 1 ? css(alone) : color, width: 1.6, dash });
      }
      return own;
    });
    const queue = [...wanted], found = [], faults = [];
    note.textContent = queue.length > 20 ? `Reading ${queue.length} FRFs …` : "";
    await Promise.all(Array.from({ length: 6 }, async () => {
      for (let next = queue.shift(); next && mine === asked; next = queue.shift()) {
        try { found.push({ ...next, ...(await frfAt(next.path)), quantity: next.row.quantity }); } catch (error) { faults.push(error.message); }
      }
    }));
    if (mine !== asked) return;
    curves = found.sort((a, b) => wanted.findIndex((w) => w.path === a.path) - wanted.findIndex((w) => w.path === b.path));
    note.textContent = [...new Set(faults)].join("; ") || (curves.length ? "" : "Choose an FRF.");
    build();
    box.dispatchEvent(new CustomEvent("chosen", { bubbles: true, detail: rowsNow }));
    for (const point of document.querySelectorAll("[data-point]")) point.classList.toggle("chosen", rowsNow.some((row) => row.points.includes(Number(point.dataset.point))));
  }

  /* The panels of a view; made anew when the view changes, filled anew otherwise. */
  function build() {
    const quantity = state.quantity || curves[0]?.quantity || "accelerance";
    const unit = FrfData.UNIT[quantity];
    for (const curve of curves) { curve.pair = FrfData.converted(curve, quantity); curve.size = null; }
    const wanted = (VIEWS[state.view] ?? VIEWS.log).map(([name, title, more]) => ({ name, title: title(unit), ...more }));
    if (["log", "db"].includes(state.view) && part("phase").checked && curves.length <= MOST_PHASES) wanted.push({ name: PHASE[0], title: PHASE[1](), ...PHASE[2] });
    if (state.view !== "nyquist" && state.view !== "cmif" && curves.some((c) => c.coherence)) wanted.push({ name: "coherence", title: "γ²", range: [0, 1.05], ticks: [0, 0.5, 1] });
    if (state.view === "nyquist") wanted[0].across = `Re H [${unit}]`;
    wanted.at(-1).last = true;
    whole = curves.length ? [Math.min(...curves.map((c) => c.hz[0])), Math.max(...curves.map((c) => c.hz.at(-1)))] : [0, 1];
    for (const panel of panels) panel.destroy();
    place.replaceChildren();
    const narrow = place.clientWidth < 640;
    const heights = { log: 330, db: 330, real: 220, imag: state.view === "nyquist" ? Math.min(560, place.clientWidth) : 220, phase: 140, coherence: 110 };
    panels = wanted.map((kind) => new FrfPanel(place, kind, (heights[kind.name] * (narrow ? 0.8 : 1)) + (kind.last ? 22 : 0), hooks));
    lines = state.view === "cmif" ? indicator(quantity) : null;
    panels[0].kind.marked = !panels[0].kind.across;
    panels.forEach((panel) => { panel.show(lines ?? curves.map((c) => drawnOf(c, panel.kind)).filter(Boolean)); pointers(panel); });
    legend();
    read();
  }
  function legend() {
    const named = state.view === "cmif" ? (lines ?? []).map((line, k) => ({ ...line, name: `singular value ${k + 1}` })) : curves;
    part("legend").replaceChildren(...named.slice(0, MOST_NAMED).map(({ color, dash, name }) => {
      const entry = document.createElement("span"), sign = document.createElement("i");
      sign.style.borderTop = `3px ${dash ? (dash[0] < 4 ? "dotted" : "dashed") : "solid"} ${color}`;
      entry.append(sign, name);
      return entry;
    }), named.length > MOST_NAMED ? `and ${named.length - MOST_NAMED} more` : "");
  }
  function drawnOf(curve, kind) {
    const look = { color: curve.color, width: curve.width, dash: curve.dash, model: curve.model };
    if (kind.name === "coherence") return curve.coherence && { ...look, x: curve.hz, y: curve.coherence };
    const y = FrfData.part(curve.pair, kind.name);
    return kind.across ? { ...look, x: FrfData.part(curve.pair, "real"), y, hz: curve.hz } : { ...look, x: curve.hz, y, wraps: kind.name === "phase" };
  }
  function indicator() {
    const measured = curves.filter((c) => !c.model && c.hz.length === curves[0].hz.length);
    if (!measured.length) return [];
    return FrfData.cmif(measured.map((c) => ({ hz: c.hz, ...c.pair, response: c.row.response, reference: c.row.reference })))
      .map((values, k) => ({ x: measured[0].hz, y: values.map((v) => (v > 0 ? Math.log10(v) : NaN)), color: k ? PALETTE[k % 8] : css("--measured"), width: 1.6 }));
  }
  const hooks = {
    key: "frf-" + Math.random(), color: css, zoom: () => state.zoom ?? whole, zoomed: (low, high) => zoomTo(low, high),
    over(panel, ctx, area) {
      const [low, high] = hooks.zoom();
      const at = (hz) => area.left + ((hz - low) / (high - low)) * area.width;
      ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
      let left = -Infinity;
      if (!panel.kind.across) for (const [number, hz, ratio] of modes()) {
        if (hz < low || hz > high) continue;
        line(ctx, at(hz), area, css("--hint"), [2, 4]);
        if (panel === panels[0] && at(hz) - left > 14 * devicePixelRatio) { left = at(hz); label(ctx, left, area.top, `${number}${ratio === null ? "" : `: ζ ${short(100 * ratio, 3)} %`}`); }
      }
      state.cursors.forEach((hz, k) => {
        if (hz === null) return;
        ctx.fillStyle = css(k ? "--initial" : "--updated");
        if (panel.kind.across) for (const curve of panel.curves) { const i = FrfData.nearest(curve.hz, hz); const box = panel.plot; ctx.beginPath(); ctx.arc(box.valToPos(curve.x[i], "x", true), box.valToPos(curve.y[i], "y", true), 5 * devicePixelRatio, 0, 7); ctx.fill(); }
        else { line(ctx, at(hz), area, ctx.fillStyle, []); if (panel === panels[0]) ctx.fillText("AB"[k], at(hz) + 4, area.top + area.height - 6); }
      });
    },
  };
  /* A name of a mode along its line, on a ground of its own so that curves do not cross it. */
  function label(ctx, x, top, text) {
    const k = devicePixelRatio;
    ctx.save(); ctx.translate(x, top + 3 * k); ctx.rotate(-Math.PI / 2); ctx.textAlign = "right";
    ctx.fillStyle = css("--ground"); ctx.globalAlpha = 0.8; ctx.fillRect(-ctx.measureText(text).width - 2 * k, -13 * k, ctx.measureText(text).width + 4 * k, 12 * k);
    ctx.globalAlpha = 1; ctx.fillStyle = css("--text"); ctx.fillText(text, 0, -3 * k);
    ctx.restore();
  }
  function line(ctx, x, area, color, dash) { ctx.beginPath(); ctx.strokeStyle = color; ctx.lineWidth = devicePixelRatio; ctx.setLineDash(dash); ctx.moveTo(x, area.top); ctx.lineTo(x, area.top + area.height); ctx.stroke(); ctx.setLineDash([]); }
  const modes = () => source.modes.find((set) => set.id === part("modes").value)?.modes ?? [];

  /* Moving is drawn once a frame with the scale of y as it is; at rest y fits what is seen. */
  function zoomTo(low, high, moving = false) {
    const [first, last] = whole;
    const wide = Math.min(Math.max(high - low, (last - first) * 1e-4), last - first);
    low = Math.min(Math.max(first, (low + high - wide) / 2), last - wide);
    state.zoom = wide >= last - first ? null : [low, low + wide];
    if (!pending) pending = requestAnimationFrame(() => { pending = 0; const began = performance.now(); panels.forEach((panel) => panel.redraw(moving)); box.dataset.frame = (performance.now() - began).toFixed(1); });
    clearTimeout(zoomTo.rest);
    zoomTo.rest = setTimeout(() => { panels.forEach((panel) => panel.fit()); remember(); }, moving ? 150 : 0);
  }
  const by = (factor, middle) => { const [low, high] = hooks.zoom(); const m = middle ?? (low + high) / 2; zoomTo(m - (m - low) * factor, m + (high - m) * factor, true); };
  const shift = (share) => { const [low, high] = hooks.zoom(); zoomTo(low + share * (high - low), high + share * (high - low), true); };
  const touches = new Map();
  function pointers(panel) {
    if (panel.kind.across) return;
    const over = panel.plot.over;
    const hzAt = (x) => panel.plot.posToVal(x - over.getBoundingClientRect().left, "x");
    over.addEventListener("wheel", (event) => { event.preventDefault(); if (event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY)) shift((event.deltaX || event.deltaY) / 1500); else by(event.deltaY > 0 ? 1.2 : 1 / 1.2, hzAt(event.clientX)); }, { passive: false });
    let pressed = null;
    over.addEventListener("pointerdown", (event) => { pressed = event.clientX; if (event.pointerType === "touch") touches.set(event.pointerId, event.clientX); });
    over.addEventListener("pointermove", (event) => {
      if (!touches.has(event.pointerId)) return;
      const before = [...touches.values()];
      touches.set(event.pointerId, event.clientX);
      const after = [...touches.values()];
      if (after.length === 1) shift((before[0] - after[0]) / over.clientWidth);
      else by(Math.abs(before[0] - before[1]) / Math.max(1, Math.abs(after[0] - after[1])), hzAt((after[0] + after[1]) / 2));
    });
    const released = (event) => touches.delete(event.pointerId);
    over.addEventListener("pointerup", (event) => { released(event); if (pressed !== null && Math.abs(event.clientX - pressed) < 4) cursorTo(hzAt(event.clientX), event.shiftKey ? 1 : state.active); pressed = null; });
    over.addEventListener("pointercancel", released);
    over.addEventListener("dblclick", () => zoomTo(...whole));
  }

  /* Cursors stand on lines of the first curve. */
  const lead = () => curves[0];
  const sizeOf = (curve) => (curve.size ??= curve.pair.re.map((re, i) => Math.hypot(re, curve.pair.im[i])));
  function cursorTo(hz, which = state.active) {
    if (!lead()) return;
    state.cursors[which] = lead().hz[FrfData.nearest(lead().hz, hz)];
    const [low, high] = hooks.zoom();
    if (hz < low || hz > high) zoomTo(hz - (high - low) / 2, hz + (high - low) / 2);
    else panels.forEach((panel) => panel.redraw());
    remember(); read();
  }
  function step(way, peak) {
    if (!lead()) return;
    const { hz } = lead();
    const from = FrfData.nearest(hz, state.cursors[state.active] ?? (way > 0 ? hooks.zoom()[0] : hooks.zoom()[1]));
    const to = peak ? FrfData.nextPeak(sizeOf(lead()), from, way) : Math.min(hz.length - 1, Math.max(0, from + way));
    if (to === null) note.textContent = "No further peak."; else { note.textContent = ""; cursorTo(hz[to]); }
  }
  /* Values at the cursors: as many digits as the lines and the random error leave. */
  function read() {
    const table = part("readings"), [a, b] = state.cursors;
    table.hidden = (a === null && b === null) || !curves.length;
    if (table.hidden) return;
    const unit = FrfData.UNIT[state.quantity || curves[0].quantity];
    const places = Math.max(0, -Math.floor(Math.log10(lead().hz[1] - lead().hz[0] || 1)));
    const hz = (value) => (value === null ? "–" : value.toFixed(places));
    const at = (curve, f) => {
      if (f === null) return ["–", "–"];
      const i = FrfData.nearest(curve.hz, f), size = sizeOf(curve)[i];
      const error = FrfData.randomError(curve.coherence?.[i], curve.row.averages);
      const digits = error ? Math.min(6, Math.max(2, 2 - Math.floor(Math.log10(error)))) : 4;
      return [`${rounded(size, digits)}${error ? ` ± ${rounded(error * size, 2)}` : ""}`, `${FrfData.part({ re: [curve.pair.re[i]], im: [curve.pair.im[i]] }, "phase")[0].toFixed(1)}°`];
    };
    const cells = curves.slice(0, MOST_NAMED).map((curve) => {
      const width = a === null ? null : FrfData.halfPower(curve.hz, sizeOf(curve), FrfData.nearest(curve.hz, a));
      const both = a !== null && b !== null;
      const [i, j] = [a, b].map((f) => (f === null ? 0 : FrfData.nearest(curve.hz, f)));
      return [curve.name, ...at(curve, a), ...at(curve, b), both ? `${(20 * Math.log10(sizeOf(curve)[j] / sizeOf(curve)[i])).toFixed(2)} dB` : "–", width ? `${short(100 * width.ratio, width.lines < 10 ? 2 : 3)} % at ${hz(width.hz)} Hz${width.lines < 4 ? `, of ${width.lines.toFixed(1)} lines only` : ""}` : "–"];
    });
    const heads = ["FRF", `A: ${hz(a)} Hz [${unit}]`, "phase", `B: ${hz(b)} Hz [${unit}]`, "phase", `B − A: ${a !== null && b !== null ? hz(b - a) : "–"} Hz`, "ζ at A, half power"];
    const made = (tag, text) => { const cell = document.createElement(tag); cell.textContent = text; if (tag === "td") cell.className = "num"; return cell; };
    table.querySelector("thead tr").replaceChildren(...heads.map((text) => made("th", text)));
    table.querySelector("tbody").replaceChildren(...cells.map((row) => { const line = document.createElement("tr"); line.append(...row.map((text, k) => made(k ? "td" : "th", text))); return line; }));
  }

  function remember() {
    const picked = chosen();
    const every = picked.length > 1 && picked.length === rows.length;
    const reference = picked.length > 8 && !every && rows.filter((row) => row.reference === picked[0].reference).length === picked.length && picked.every((row) => row.reference === picked[0].reference);
    keep({
      frf: null, hz: null, s: every ? "*" : reference ? "ref~" + picked[0].reference : picked.map((row) => row.key).join(",") || null,
      v: state.view === "log" ? null : state.view, q: state.quantity || null, z: state.zoom ? state.zoom.map((v) => short(v)).join("~") : null,
      a: state.cursors[0] === null ? null : short(state.cursors[0]), b: state.cursors[1] === null ? null : short(state.cursors[1]),
      m: part("model").value || null, ms: part("modes").value === source.modes.at(-1)?.id ? null : part("modes").value || "none",
      c: source.campaigns.slice(1).map((c) => c.id).join(",") || null,
    });
  }
  /* What the address says: also as earlier versions wrote it, an FRF by its id or points, a band by its middle. */
  function recall() {
    const said = shown.get("s"), old = shown.get("frf");
    const [middle, half] = (shown.get("hz") ?? "").split("~").map(Number);
    if (middle && half) state.zoom = [Math.max(0, middle - half), middle + half];
    if (said === "*") return () => true;
    if (said?.startsWith("ref~")) return (row) => row.reference === said.slice(4);
    if (said) { const keys = said.split(","); return (row) => keys.includes(row.key); }
    const first = rows.find((row) => old && (row.id === old || row.points.join("~") === old || String(row.points[0]) === old)) ?? rows[0];
    return (row) => row === first;
  }
  async function addCampaign(id) {
    if (source.campaigns.some((c) => c.id === id)) return;
    const found = { id, name: (await get(`campaigns/${id}`)).name, frfs: [] };
    for (let cursor = null, more = true; more; more = cursor !== null) {
      const page = await get(`campaigns/${id}/frfs?limit=1000${cursor ? `&cursor=${encodeURIComponent(cursor)}` : ""}`);
      found.frfs.push(...page.items.map((f) => [f.id, f.response_point, f.response_direction, f.reference_point, f.reference_direction, f.quantity, f.label, f.averages]));
      cursor = page.next_cursor;
    }
    source.campaigns.push(found);
    add(found);
    [...part("other").options].find((o) => o.value === id)?.remove();
  }

  async function give(name, kind, content) {
    const blob = content instanceof Blob ? content : new Blob([content], { type: kind });
    try {
      await navigator.clipboard.write([new ClipboardItem({ [kind === "image/png" ? kind : "text/plain"]: kind === "image/png" ? blob : new Blob([content], { type: "text/plain" }) })]);
      note.textContent = `${name.toUpperCase()} copied.`;
    } catch { // a page without TLS has no clipboard, and a reader may refuse it
      const link = document.createElement("a");
      link.href = URL.createObjectURL(blob); link.download = `frfs.${name}`; link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 10000);
      note.textContent = `frfs.${name} saved: this browser lends no clipboard here.`;
    }
  }
  function tableOf() {
    const [low, high] = hooks.zoom();
    const quantity = state.quantity || curves[0]?.quantity;
    const quoted = (text) => `"${text.replaceAll('"', '""')}"`;
    if (state.view === "cmif") return [["frequency_hz", ...lines.map((_, k) => `singular_value_${k + 1}`)].join(","), ...Array.from(lines[0]?.x ?? [], (hz, i) => [hz, ...lines.map((l) => 10 ** l.y[i])].join(",")).filter((row) => Number(row.split(",")[0]) >= low && Number(row.split(",")[0]) <= high)].join("\n");
    const blocks = ["frf,quantity,unit,frequency_hz,real,imag,coherence"];
    for (const c of curves) c.hz.forEach((hz, i) => { if (hz >= low && hz <= high) blocks.push([quoted(c.name), quantity, FrfData.UNIT[quantity], hz, c.pair.re[i], c.pair.im[i], c.coherence?.[i] ?? ""].join(",")); });
    return blocks.join("\n") + "\n";
  }
  const DONE = {
    whole: () => zoomTo(...whole), closer: () => by(0.6), wider: () => by(1 / 0.6), before: () => step(-1, true), next: () => step(1, true),
    clear: () => { state.cursors = [null, null]; panels.forEach((panel) => panel.redraw()); remember(); read(); },
    csv: () => give("csv", "text/csv", tableOf()), png: async () => give("png", "image/png", await pictureOf(panels, css("--ground"))),
    svg: () => give("svg", "image/svg+xml", drawingOf(panels, { text: css("--text"), line: css("--hint"), ground: css("--ground") })),
  };
  box.addEventListener("click", (event) => { const does = event.target.closest("button")?.dataset.do; if (does) DONE[does]?.(); });
  for (const button of box.querySelectorAll("[data-cursor]")) button.addEventListener("click", () => {
    state.active = Number(button.dataset.cursor);
    for (const other of box.querySelectorAll("[data-cursor]")) other.setAttribute("aria-pressed", String(other === button));
  });
  place.addEventListener("keydown", (event) => {
    const does = { ArrowLeft: () => (event.shiftKey ? shift(-0.2) : step(-1)), ArrowRight: () => (event.shiftKey ? shift(0.2) : step(1)), PageUp: DONE.before, PageDown: DONE.next, "+": DONE.closer, "-": DONE.wider, 0: DONE.whole }[event.key];
    if (does) { event.preventDefault(); does(); }
  });
  list.addEventListener("change", load);
  part("all").addEventListener("change", () => { const which = part("all").value; if (which) choose((row) => which === "*" || row.reference === which || "r" + row.response === which); });
  part("view").value = state.view in VIEWS ? state.view : "log";
  part("view").addEventListener("change", () => { state.view = part("view").value; remember(); build(); });
  part("quantity").value = state.quantity;
  part("quantity").addEventListener("change", () => { state.quantity = part("quantity").value; remember(); build(); });
  part("phase").addEventListener("change", build);
  part("model").addEventListener("change", load);
  part("modes").addEventListener("change", () => { panels.forEach((panel) => panel.redraw()); remember(); });
  part("other")?.addEventListener("change", async () => { try { await addCampaign(part("other").value); list.focus(); } catch (error) { note.textContent = error.message; } part("other").value = ""; });
  new ResizeObserver(() => { if (panels.length && panels[0].plot.width !== place.clientWidth) build(); }).observe(place);
  /* A point that is chosen elsewhere on the page, in a drawing or in space. */
  document.addEventListener("point-chosen", ({ detail: { point, more } }) => {
    const mine = rows.filter((row) => row.points.includes(Number(point)));
    if (!mine.length) return;
    const next = (mine.findIndex((row) => row.option.selected) + 1) % mine.length;
    choose((row) => (more && row.option.selected) || row === mine[next]);
  });
  document.addEventListener("zoom-frfs", ({ detail: { low, high, moving } }) => zoomTo(low, high, moving));

  source.modes.forEach((set) => part("modes").append(new Option(set.name, set.id)));
  part("modes").value = shown.get("ms") === "none" ? "" : shown.get("ms") ?? source.modes.at(-1)?.id ?? "";
  source.jobs.forEach(([id, name]) => part("model").append(new Option(name, id)));
  part("model").value = shown.get("m") ?? (source.job || "");
  add(source.campaigns[0], true);
  const others = (shown.get("c") ?? "").split(",").filter(Boolean);
  const once = new IntersectionObserver(async (entries) => {
    if (!entries.some((e) => e.isIntersecting)) return;
    once.disconnect();
    for (const id of others) await addCampaign(id).catch((error) => { note.textContent = error.message; });
    choose(recall());
  }, { rootMargin: "300px" });
  once.observe(box);
  if (shown.has("hz")) goTo(box); // an old address of a mode
}
for (const box of document.querySelectorAll("[data-frf-viewer]")) openViewer(box);
for (const point of document.querySelectorAll("[data-point]")) point.addEventListener("click", (event) => {
  event.preventDefault();
  document.dispatchEvent(new CustomEvent("point-chosen", { detail: { point: point.dataset.point, more: event.ctrlKey || event.metaKey || event.shiftKey } }));
});
