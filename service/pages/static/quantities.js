"use strict";
/* Quantities are read by the service, in one place for all pages: what it understood stands below
   the field, and is sent. */
const UNDERSTOOD = new Map(); // question as JSON -> its answer
const kindOf = (input) =>
  input.dataset.quantity ?? ("array" in input.dataset ? "array" : undefined);
function questionOf(input) {
  const { unit = "", to = "", of, unitFrom } = input.dataset,
    beside = (name) => input.form.elements[name].value.trim();
  const chosen = unitFrom && beside(unitFrom);
  const asked = {
    text: input.value.trim(),
    kind: kindOf(input),
    unit: chosen || unit,
    to: chosen || to,
  };
  if (of) asked.of = beside(input.name.replace(/[^/]+$/, of));
  return JSON.stringify(asked);
}
async function ask(questions) {
  const unknown = [...new Set(questions)].filter((one) => !UNDERSTOOD.has(one));
  if (!unknown.length) return;
  const answer = await fetch(at("ui/quantities"), {
    method: "POST",
    body: `[${unknown}]`,
    headers: {
      Accept: "application/json",
      "Content-Type": "application/json",
      "X-CSRF-Token": page.csrf,
    },
  });
  if (!answer.ok) throw { detail: "What was typed could not be read; try again." };
  (await answer.json()).forEach((read, i) => UNDERSTOOD.set(unknown[i], read));
}
const typedIn = (form) =>
  [...form.elements].filter(
    (input) =>
      kindOf(input) &&
      input.name &&
      input.value.trim() &&
      !input.matches(":disabled") &&
      !input.closest("template"),
  );
async function understand(form) {
  const inputs = typedIn(form);
  await ask(inputs.map(questionOf));
  const errors = inputs
    .map((input) => ({ input, ...showUnderstood(input) }))
    .filter(({ fault }) => fault)
    .map(({ input, fault }) => ({ pointer: "/" + input.name, detail: fault }));
  if (errors.length) throw { errors };
}
function showUnderstood(input) {
  const read = input.value.trim() ? UNDERSTOOD.get(questionOf(input)) : {};
  let below = input.parentElement.querySelector(":scope > .understood");
  if (!below)
    input.after((below = made("small", { className: "understood", role: "status" })));
  below.textContent = read?.fault ?? (read?.words ? `= ${read.words}` : "");
  for (const one of read?.readings ?? []) {
    const onclick = () => {
      input.value = one;
      echo(input);
    };
    below.append(" ", made("button", { type: "button", className: "plain", onclick }, `Take ${one}`));
  }
  below.classList.toggle("wrong", Boolean(read?.fault));
  input.setCustomValidity(read?.fault ?? "");
  return read ?? {};
}
const waiting = new WeakMap(); // input -> the timer of its question
async function echo(input) {
  if (input.value.trim()) await ask([questionOf(input)]).catch(() => {});
  if (input.isConnected) showUnderstood(input);
}
document.addEventListener("input", ({ target }) => {
  if (!target.form || !target.dataset) return;
  const row = target.closest(".one") ?? target.form; // a name or a choice may be the unit of what stands beside it
  const about = [target, ...row.querySelectorAll("[data-of], [data-unit-from]")].filter((input) =>
    kindOf(input),
  );
  for (const input of new Set(about)) {
    input.setCustomValidity("");
    clearTimeout(waiting.get(input));
    waiting.set(input, setTimeout(echo, 150, input));
  }
});
/* What REST says, in the words of a form: a pointer is the label of its field, a member in a
   sentence too. */
let speaking = null; // form that is sent
const inputOf = (form, name) => {
  const all = [...(form?.elements ?? [])].filter(
    (input) => input.name && !input.closest("template"),
  );
  const like = [
    (one) => one === name || one === `${name}[]`,
    (one) => name.startsWith(one + "/"),
    (one) => one.startsWith(name + "/"),
    (one) => one.endsWith("/" + name),
  ];
  for (const test of like) {
    const found = all.find((input) => test(input.name));
    if (found) return found;
  }
  return null;
};
const UNIT_ENDING = /_(m|Pa|kg|hz|s|c|deg|percent|kg_m3|kg_m2|per_s)$/;
const pathOf = (name) => name.replace(/^\//, "").replaceAll(".", "/");
const wordsOf = (name) =>
  name
    .split(/[/.]/)
    .filter(Boolean)
    .map((step) =>
      /^\d+$/.test(step)
        ? String(Number(step) + 1)
        : step.replace(UNIT_ENDING, "").replaceAll("_", " "),
    )
    .join(" ");
function labelOf(form, name) {
  const input = inputOf(form, name),
    label = input?.closest("label")?.firstChild?.textContent?.trim();
  if (!label) return wordsOf(name);
  const row = input.closest(".one"),
    set = (row ?? input).closest("fieldset.rows, fieldset.pair"),
    legend = set?.querySelector("legend")?.textContent;
  return [
    legend && (row ? `${legend} ${[...set.querySelectorAll(".one")].indexOf(row) + 1}` : legend),
    label,
  ]
    .filter(Boolean)
    .join(", ");
}
const inWords = (form, text) =>
  text
    .replace(/ ?[^.;:?(]*\((?:`[^`]*`(?:, )?)+\)/g, "") // what a script or a command would add
    .replace(/`([a-z]\w*(?:[./]\w+)*)`/gi, (_, name) =>
      inputOf(form, name) ? `“${labelOf(form, name)}”` : wordsOf(name),
    )
    .replace(/(?<![\w/])\/?[a-z]\w*(?:[./][a-z]\w*)*_\w+/gi, (name) =>
      inputOf(form, pathOf(name)) || UNIT_ENDING.test(name)
        ? `“${labelOf(form, pathOf(name))}”`
        : name,
    );
function linesOf(form, problem) {
  const lines = (problem.errors ?? []).map(({ pointer, detail }) => {
    const name = pointer.replace(/^\//, "");
    return name ? `${labelOf(form, name)}: ${inWords(form, detail)}` : inWords(form, detail);
  });
  return lines.length ? lines : [inWords(form, problem.detail || String(problem))];
}
