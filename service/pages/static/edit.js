"use strict";
/* Correcting: a form that names what it edits is filled from REST, and sends back what differs,
   with the tag of what was read, so that nobody's change is lost. Only whole members are sent, as
   PATCH takes them. */
const EDITED = new Map(); // form -> what was read, and its tag

async function readInto(form) {
  const answer = await fetch(rest(form.dataset.edit), {
    headers: { Accept: "application/json" },
  });
  const value = await answer.json();
  if (!answer.ok) throw value;
  EDITED.set(form, { value, tag: answer.headers.get("ETag") });
  for (const rows of tablesOf(form))
    for (const row of member(value, rows.dataset.rows) ?? []) addRow(rows, row);
  for (const input of fieldsOf(form)) {
    const found = member(value, input.name);
    if (found === null || found === undefined) continue;
    input.value = shownIn(input, found);
  }
}
const member = (value, pointer) => pointer.split("/").reduce((node, step) => node?.[step], value);
const tablesOf = (form) => [...form.querySelectorAll("[data-rows]")];
const fieldsOf = (form) =>
  [...form.elements].filter(
    (input) =>
      input.name &&
      input.type !== "submit" &&
      input.type !== "hidden" &&
      !input.closest("[data-rows]"),
  );
const fixedOf = (form) =>
  [...form.elements].filter((input) => input.name && input.type === "hidden"); // what a button means
/* What lines of pairs say: a line that stayed is what it was; of metadata a number is one. */
function pairsOf(input, before) {
  const said = valueOf(input) ?? {};
  const isNumber = (text) =>
    input.dataset.pairs === "typed" && text !== "" && !Number.isNaN(Number(text));
  for (const [key, text] of Object.entries(said))
    said[key] =
      before?.[key] !== undefined && lineOf(before[key]) === text
        ? before[key]
        : isNumber(text)
          ? Number(text)
          : text;
  return said;
}
/* Members of which a field was changed, each whole; null where a field was emptied. */
function changesOf(form) {
  const { value } = EDITED.get(form);
  const next = structuredClone(value);
  for (const input of fieldsOf(form)) {
    const before = member(value, input.name);
    if (
      String(before === null || before === undefined ? "" : shownIn(input, before)) === input.value
    )
      continue; // as it was, to the last digit
    put(
      next,
      input.name,
      "text" in input.dataset
        ? input.value.trim()
        : "pairs" in input.dataset
          ? pairsOf(input, before)
          : (valueOf(input) ?? ("list" in input.dataset ? [] : null)),
    );
  }
  const members = new Set(fieldsOf(form).map((input) => input.name.split("/")[0]));
  for (const {
    dataset: { rows },
  } of tablesOf(form)) {
    const stated = (list) =>
      JSON.stringify(
        (list ?? []).map((row) =>
          Object.fromEntries(Object.entries(row).filter(([, item]) => item !== null)),
        ),
      );
    const list = member(bodyOf(form), rows) ?? [];
    if (stated(list) !== stated(member(value, rows))) put(next, rows, list);
    members.add(rows.split("/")[0]);
  }
  for (const input of fixedOf(form)) {
    put(next, input.name, valueOf(input) ?? null);
    members.add(input.name);
  }
  return Object.fromEntries(
    [...members]
      .filter((name) => JSON.stringify(next[name]) !== JSON.stringify(value[name]))
      .map((name) => [name, next[name]]),
  );
}
async function sendChanges(form) {
  const changes = changesOf(form);
  if (!Object.keys(changes).length) throw { detail: "Nothing was changed." };
  await send("PATCH", form.dataset.edit, changes, { "If-Match": EDITED.get(form).tag });
  goOn(form.dataset.then);
}
for (const form of document.querySelectorAll("form[data-edit]")) {
  const button = form.querySelector("button[type=submit]");
  button.disabled = true;
  readInto(form)
    .then(
      () => {
        button.disabled = false;
      },
      (problem) => showFaults(form, problem),
    )
    .finally(() => {
      form.dataset.begun = "";
    });
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    submitted(form, () => sendChanges(form));
  });
}

/* Poles that are kept or dropped: the form of a mode set shows itself when its boxes differ from
   the set, and sends the difference. */
const polesOf = (form) => [...form.elements].filter((input) => input.dataset.pole);
for (const form of document.querySelectorAll("form[data-poles]")) {
  const changed = () => polesOf(form).filter((box) => box.checked !== box.defaultChecked);
  for (const box of polesOf(form))
    box.addEventListener("change", () => {
      form.hidden = !changed().length;
      box.closest("tr").classList.toggle("edited", box.checked !== box.defaultChecked);
      const hz = short(Number(box.dataset.pole), 5);
      const then = form.hidden ? "as it was" : `save it as a new mode set, above`;
      say(`${hz} Hz: ${box.checked ? "kept" : "dropped"}; ${then}.`, () => box.click());
    });
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const reason = form.elements.reason.value.trim();
    const decisions = changed().map((box) => ({
      frequency_hz: Number(box.dataset.pole),
      keep: box.checked,
      reason,
    }));
    submitted(form, async () => {
      const body = { name: form.elements.name.value.trim(), decisions };
      const { name, modes } = await send("POST", form.dataset.poles, body);
      sessionStorage.setItem("done", `Saved as “${name}”: ${modes.length} modes.`);
      goOn(form.dataset.then);
    });
  });
}
/* A click on a pole of a stabilisation diagram turns the box of the fitted pole that it stands for;
   a pole that stands for none comes into the form of those to fit. */
for (const figure of document.querySelectorAll("figure[data-figure$='/figures/stabilisation']"))
  figure.addEventListener("drawn", () => {
    const of = figure.dataset.figure.split("/")[1];
    const set = [...document.querySelectorAll(`[data-set-of="${of}"]`)].at(-1); // edited last
    const fit = document.querySelector(`form[data-fit="${of}"]`);
    if (set || fit)
      figure.querySelector(".js-plotly-plot").on("plotly_click", ({ points: [point] }) => {
        const hz = point.customdata ?? point.x;
        const off = (box) => Math.abs(Number(box.dataset.pole) / hz - 1);
        const boxes = [...(set?.querySelectorAll("[data-pole]") ?? [])];
        const [box] = boxes.sort((a, b) => off(a) - off(b));
        if (!box || off(box) > 1e-3) {
          if (!fit || point.customdata)
            return say(`No fitted pole lies near ${short(point.x, 5)} Hz.`);
          const rows = fit.querySelector("[data-rows]");
          if (fit.hidden) for (const pole of JSON.parse(fit.dataset.stated)) addRow(rows, pole);
          addRow(rows, {
            frequency_hz: point.x,
            damping_ratio: Number.parseFloat(point.text) / 100,
          });
          fit.hidden = false;
          return say(`${short(point.x, 5)} Hz: to be fitted.`);
        }
        return box.click();
      });
  });
