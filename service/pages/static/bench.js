"use strict";
/* A workbench: a mode is chosen in one place, a row, a cell of the MAC, a number over the curves,
   a list or by arrow keys, and is seen in all. */
const modeRows = () =>
  [...document.querySelectorAll("tr[data-zoom]")].filter(
    (row) => !row.closest("[data-set-key][hidden]"),
  );
const cells = [...document.querySelectorAll("[data-pair]")];
let modePair = [],
  chosenShape = null;

/* Of a result the row has a number and its partner's; of a mode set it names the set. */
function chooseMode({ measured, number = measured, model, quiet = false }) {
  const rows = modeRows();
  const row = rows.find((each) => each.dataset.mode === String(number));
  const { mode, partner, set, shape, zoom } = row?.dataset ?? {};
  modePair = [mode ?? String(number ?? ""), String(model ?? partner ?? "")];
  if (row) {
    const { sheet } = row.closest(".sheet");
    sheet.choose([row]);
    if (!quiet) row.scrollIntoView({ block: "nearest" });
  }
  for (const cell of cells)
    cell.setAttribute("aria-pressed", String(cell.dataset.pair === modePair.join("~")));
  if (set && !quiet) keep({ mode });
  else if (!quiet) keep({ "space-measured": modePair[0], "space-model": modePair[1] || null });
  tell("mode-chosen", { pair: modePair, hz: Number(zoom) });
  chosenShape = set && shape !== undefined ? { set, number: Number(mode) } : null;
  if (chosenShape && !quiet) tell("shape-chosen", chosenShape);
}
function zoomTo({ dataset: { zoom, damping } }) {
  const hz = Number(zoom),
    half = Math.max(0.25 * hz, 12 * Number(damping) * hz);
  tell("zoom-frfs", { low: Math.max(0, hz - half), high: hz + half });
}
hear("choose-mode", chooseMode);
document.addEventListener("picked", ({ detail: row }) => {
  if (row.dataset.zoom) chooseMode({ number: row.dataset.mode });
});
document.addEventListener("dblclick", ({ target }) => {
  const row = target.closest?.("tr[data-zoom]");
  if (row) zoomTo(row);
});
document.addEventListener("click", (event) => {
  const cell = event.target.closest?.("[data-pair]");
  const link = event.target.closest?.("tr[data-zoom] a");
  if (cell) {
    const [measured, model] = cell.dataset.pair.split("~");
    chooseMode({ measured, model });
  }
  if (!link) return;
  event.preventDefault();
  const row = link.closest("tr");
  chooseMode({ number: row.dataset.mode });
  zoomTo(row);
  if (matchMedia("(max-width: 760px)").matches) seePane(document.getElementById("frfs"));
});
/* Left and right choose the mode before and after; A and R keep and drop it. */
document.addEventListener("keydown", (event) => {
  const { key, target, ctrlKey, metaKey, altKey } = event;
  const away = "input, select, textarea, canvas, dialog, [data-panels], [role=separator]";
  if (ctrlKey || metaKey || altKey || target.closest?.(away)) return;
  const rows = modeRows();
  const at = rows.findIndex((row) => row.ariaSelected === "true");
  const to = { ArrowLeft: at - 1, ArrowRight: at + 1 }[key];
  if (rows[to]) {
    event.preventDefault();
    chooseMode({ number: rows[to].dataset.mode });
  }
  const box = { a: true, r: false }[key];
  const keeps = rows[at]?.querySelector("[data-pole]");
  if (box !== undefined && keeps && !keeps.disabled && keeps.checked !== box) keeps.click();
});

/* What the address says, or the first. */
function firstMode() {
  const number = shown.get("space-measured") ?? shown.get("mode") ?? modeRows()[0]?.dataset.mode;
  if (number !== undefined)
    chooseMode({ number, model: shown.get("space-model") ?? undefined, quiet: true });
}
/* Of several mode sets one is seen, and marked over the curves. */
const setList = document.querySelector("[data-sets]");
function seeSet() {
  for (const set of document.querySelectorAll("[data-set-key]"))
    set.hidden = set.dataset.setKey !== setList.value;
  const marks = document.querySelector("[data-modes]");
  if (marks && marks.value !== setList.value) {
    marks.value = setList.value;
    marks.dispatchEvent(new Event("change"));
  }
  firstMode();
}
setList?.addEventListener("change", () => {
  keep({ mode: null, set: setList.value });
  seeSet();
});
if (setList && [...setList.options].some(({ value }) => value === shown.get("set")))
  setList.value = shown.get("set");
if (setList) seeSet();
else firstMode();
/* A hit that is chosen shows its point. */
document.addEventListener("picked", ({ detail: { dataset } }) => {
  if (dataset.hitAt) tell("point-chosen", { point: dataset.hitAt });
});
