"use strict";
/* Where to hit next: the form's tests and what was measured go to REST, and the ranking that comes
   back is written as a table. */
const planned = document.querySelector("form[data-plan]");
const answer = document.querySelector("[data-answer]");
const three = (value) => short(value, 3);
const inLaboratory = (name, value) =>
  /^[EG]/.test(name) ? `${three(value / 1e9)} GPa` : three(value);

const cell = (tag, text, className = "") => made(tag, { className }, text);
function rowOf(item, names) {
  const count = item.points_m.length;
  const points = made(
    "details",
    {},
    cell("summary", count === 1 ? "1 point" : `${count} points`),
    item.points_m.map(([x, y]) => `(${three(1000 * x)}, ${three(1000 * y)})`).join(" "),
  );
  return made(
    "tr",
    {},
    cell("th", item.name),
    cell("td", item.information_nats.toFixed(2), "num"),
    ...names.map((name) => cell("td", inLaboratory(name, item.expected_sd[name]), "num")),
    cell("td", item.shrinks_most),
    cell("td", String(item.frequencies_hz.length), "num"),
    cell("td", `${Math.round(100 * item.share_of_all_points)} %`, "num"),
    cell("td", points, "text"),
  );
}
function write(plan) {
  const names = Object.keys(plan.known_sd);
  const heads = [
    "Test",
    "Information [nats]",
    ...names.map((name) => `sd of ${name}`),
    "Shrinks most",
    "Modes",
    "Of all points",
    "Hit at (x, y) [mm], in this order",
  ];
  answer.querySelector("thead tr").replaceChildren(...heads.map((text) => cell("th", text)));
  answer.querySelector("tbody").replaceChildren(...plan.items.map((item) => rowOf(item, names)));
  answer.querySelector("[data-known]").textContent =
    `Known now${plan.campaigns.length ? `, by ${plan.campaigns.join("; ")}` : ""}: ${names.map((name) => `${name} ± ${inLaboratory(name, plan.known_sd[name])}`).join(", ")}.`;
  answer.hidden = false;
  answer.scrollIntoView({ block: "start" });
}
/* A mass needs its place: one without stands at the origin, and a place without a mass is none. */
function asked() {
  const body = bodyOf(planned);
  for (const test of body.tests ?? []) {
    if (test.added_masses?.[0].mass_kg === undefined) delete test.added_masses;
    else test.added_masses = [{ x_m: 0, y_m: 0, ...test.added_masses[0] }];
  }
  const made = [...planned.querySelectorAll("[data-made]:checked")].map((box) => ({
    campaign_id: box.dataset.made,
    mode_set: box.value,
  }));
  return { ...body, made };
}
planned.addEventListener("submit", (event) => {
  event.preventDefault();
  submitted(planned, async () => write(await send("POST", planned.dataset.plan, asked())));
});
