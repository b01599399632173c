"use strict";
/* Suggestions of the search box: fields while a name is typed, what a field is compared by, and
   values that are there. */
const box = document.querySelector("[data-suggest]");
const list = document.getElementById("suggestions");
const hints = JSON.parse(document.getElementById("hints").textContent);
const noun = box.form.elements.noun;
const COMPARED = {
  number: ["=", "<", ">", "BETWEEN"],
  whole: ["=", "<", ">", "BETWEEN"],
  time: [">", "<", "BETWEEN"],
  text: ["=", "LIKE", "<>", "IN"],
  truth: ["= TRUE", "= FALSE"],
  tags: ["=", "LIKE"],
  id: ["="],
  json: [],
};
let chosen = -1,
  asked = 0;

/* What stands before the cursor: a name that is begun, or a field with its operator and a value
   that is begun. */
function begun() {
  const before = box.value.slice(0, box.selectionStart);
  const value = /([\w.]+)\s*(=|<>|LIKE|IN)\s*\(?\s*'((?:[^']|'')*)$/i.exec(before);
  if (value) return { field: value[1], begun: value[3], from: before.length - value[3].length };
  const compared = /([\w.]+)\s+$/.exec(before);
  if (compared && hints.some((one) => one.name === compared[1]))
    return { after: compared[1], from: before.length };
  const name = /(?:^|[\s(])([\w.]*)$/.exec(before);
  return name ? { name: name[1], from: before.length - name[1].length } : null;
}
async function wanted(at) {
  if (at.after) {
    const field = hints.find((one) => one.name === at.after);
    return COMPARED[field.kind].map((text) => ({ text: text + " ", means: "" }));
  }
  if (at.field) {
    const query = new URLSearchParams({ limit: 1, facets: at.field });
    const found = await call("GET", `search/${noun.value}?${query}`).catch(() => ({ facets: {} }));
    const counts = Object.entries(Object.values(found.facets)[0] ?? {});
    return counts
      .filter(([value]) => value && value.toLowerCase().startsWith(at.begun.toLowerCase()))
      .map(([value, times]) => ({
        text: value.replaceAll("'", "''") + "' ",
        shown: value,
        means: String(times),
      }));
  }
  const begun = at.name.toLowerCase();
  if (!begun) return [];
  const rank = (one) => (one.name.startsWith(begun) ? 0 : one.name.includes(begun) ? 1 : 2);
  return hints
    .filter((one) => rank(one) < 2 && one.name !== at.name)
    .sort((a, b) => rank(a) - rank(b))
    .slice(0, 8)
    .map((one) => ({ text: one.name + " ", shown: one.name, means: one.means }));
}
async function suggest() {
  const turn = ++asked,
    at = begun();
  const found = at ? await wanted(at) : [];
  if (turn !== asked) return;
  chosen = -1;
  list.replaceChildren(
    ...found.map((one, i) => {
      const is = { id: `suggestion-${i}`, role: "option", ariaSelected: "false" };
      const item = made("li", is, one.shown ?? one.text, made("small", {}, one.means));
      item.addEventListener("mousedown", (event) => {
        event.preventDefault();
        take(one.text, at.from);
      });
      item.take = () => take(one.text, at.from);
      return item;
    }),
  );
  list.hidden = found.length === 0;
  box.setAttribute("aria-expanded", String(!list.hidden));
  box.removeAttribute("aria-activedescendant");
}
function take(text, from) {
  box.setRangeText(text, from, box.selectionStart, "end");
  box.focus();
  suggest();
}
function mark(step) {
  const items = [...list.children];
  chosen = (chosen + step + items.length + (chosen < 0 && step < 0 ? 1 : 0)) % items.length;
  items.forEach((item, i) => item.setAttribute("aria-selected", String(i === chosen)));
  box.setAttribute("aria-activedescendant", items[chosen].id);
  items[chosen].scrollIntoView({ block: "nearest" });
}
function close() {
  list.hidden = true;
  box.setAttribute("aria-expanded", "false");
  asked += 1;
}
box.addEventListener("input", suggest);
box.addEventListener("blur", close);
box.addEventListener("keydown", (event) => {
  if (list.hidden) return;
  if (event.key === "ArrowDown" || event.key === "ArrowUp") {
    event.preventDefault();
    mark(event.key === "ArrowDown" ? 1 : -1);
  } else if ((event.key === "Enter" || event.key === "Tab") && chosen >= 0) {
    event.preventDefault();
    list.children[chosen].take();
  } else if (event.key === "Escape") {
    event.preventDefault();
    close();
  }
});
/* Another kind has other fields: the columns that were chosen are left behind. */
noun.addEventListener("change", () => {
  for (const input of box.form.querySelectorAll("[name=fields]:checked")) input.checked = false;
  box.form.querySelector("[name=sort]")?.remove();
  if (!box.value) box.form.requestSubmit();
});
