"use strict";
/* Mode shapes on a canvas: the measured points move out of plane, 60 times a second unless the reader wants stillness. */
const view3 = document.querySelector("[data-shape-view]");
if (view3) {
  const canvas = view3.querySelector("canvas");
  const pen = canvas.getContext("2d");
  const stop = view3.querySelector("[data-shape-still]");
  const quiet = matchMedia("(prefers-reduced-motion: reduce)");
  const color = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  let points = null, shape = null, running = false, frame = 0;
  const ask = async (path) => (await fetch(new URL(document.documentElement.dataset.root + "api/v1/" + path, location.href), { credentials: "same-origin", headers: { Accept: "application/json" } })).json();

  function place(amplitude) {
    const all = shape.points.map((p) => ({ ...p, out: amplitude(p) }));
    const [x0, x1] = [Math.min(...all.map((p) => p.x)), Math.max(...all.map((p) => p.x))];
    const [y0, y1] = [Math.min(...all.map((p) => p.y)), Math.max(...all.map((p) => p.y))];
    const long = Math.max(x1 - x0, y1 - y0, 1e-9);
    const scale = 0.78 * canvas.width / (x1 - x0 + 0.5 * (y1 - y0) || long);
    return all.map((p) => ({ ...p, sx: 0.1 * canvas.width + scale * (p.x - x0 + 0.5 * (p.y - y0)), sy: 0.62 * canvas.height - 0.35 * scale * (p.y - (y0 + y1) / 2) - 0.3 * canvas.height * p.out }));
  }
  function lines(all, style, dash) {
    pen.strokeStyle = style; pen.setLineDash(dash); pen.lineWidth = 2;
    const rows = new Map();
    for (const p of all) { const key = Math.round(p.y * 1e4); rows.set(key, [...(rows.get(key) ?? []), p]); }
    for (const row of rows.values()) {
      pen.beginPath();
      row.sort((a, b) => a.x - b.x).forEach((p, i) => (i ? pen.lineTo(p.sx, p.sy) : pen.moveTo(p.sx, p.sy)));
      pen.stroke();
    }
    pen.setLineDash([]);
  }
  function paint(phase) {
    pen.clearRect(0, 0, canvas.width, canvas.height);
    lines(place(() => 0), color("--hint"), [3, 4]);
    const moved = place((p) => p.re * Math.cos(phase) - p.im * Math.sin(phase));
    lines(moved, color("--updated"), []);
    pen.fillStyle = color("--measured");
    for (const p of moved) { pen.beginPath(); pen.arc(p.sx, p.sy, 4, 0, 7); pen.fill(); }
  }
  function step(now) { if (!running) return; paint(now / 350); frame = requestAnimationFrame(step); }
  function run(on) {
    running = on; cancelAnimationFrame(frame);
    stop.textContent = on ? "Stop" : "Move"; stop.setAttribute("aria-pressed", String(!on));
    if (on) frame = requestAnimationFrame(step); else if (shape) paint(0);
  }
  stop.addEventListener("click", () => run(!running));
  for (const button of document.querySelectorAll("[data-shape]")) button.addEventListener("click", async () => {
    points ??= Object.fromEntries((await ask(`campaigns/${view3.dataset.campaign}/grid-points`)).items.map((p) => [p.label, p]));
    const set = await ask(`mode-sets/${button.dataset.shape}`);
    const mode = set.modes.find((m) => m.number === Number(button.dataset.mode));
    const main = mode.shape.reduce((best, v) => (Math.hypot(v.real, v.imag) > Math.hypot(best.real, best.imag) ? v : best));
    const [size, angle, axis] = [Math.hypot(main.real, main.imag), Math.atan2(main.imag, main.real), Math.abs(main.direction)];
    shape = { points: mode.shape.filter((v) => Math.abs(v.direction) === axis && points[v.point]).map((v) => {
      const [r, a] = [Math.hypot(v.real, v.imag) / size * Math.sign(v.direction), Math.atan2(v.imag, v.real) - angle];
      return { x: points[v.point].x_m, y: points[v.point].y_m, re: r * Math.cos(a), im: r * Math.sin(a) };
    }) };
    view3.hidden = false;
    view3.querySelector("[data-shape-name]").textContent = `${set.name}, mode ${mode.number}: ${mode.frequency_hz.toPrecision(5)} Hz`;
    canvas.setAttribute("aria-label", `Shape of mode ${mode.number} at ${mode.frequency_hz.toPrecision(5)} Hz, ${shape.points.length} points`);
    run(!quiet.matches);
    view3.scrollIntoView({ block: "nearest" });
  });
}
