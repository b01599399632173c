"use strict";
/* What every page does: forms that speak REST with the session's token, files dropped in, the session itself. */
const page = document.documentElement.dataset;
const at = (path) => new URL(page.root + path, location.href).href;
const rest = (path) => at("api/v1/" + path);

async function call(method, path, body, headers = {}) {
  const answer = await fetch(rest(path), {
    method, body, credentials: "same-origin", headers: { Accept: "application/json", "X-CSRF-Token": page.csrf, ...headers },
  });
  const text = await answer.text();
  const value = text ? JSON.parse(text) : null;
  if (answer.status === 401 && page.csrf) location.assign(at("sign-in?next=" + encodeURIComponent(location.pathname.slice(new URL(at("")).pathname.length))));
  if (!answer.ok) throw value ?? { detail: `status ${answer.status}` };
  return value;
}
/* Numbers that are probably in another unit are sent again where a person says that they are meant. */
async function send(method, path, value, headers = {}) {
  const json = (to) => call(method, to, JSON.stringify(value), { "Content-Type": "application/json", ...headers });
  try { return await json(path); } catch (problem) {
    if (!problem.confirmable || !confirm(`${problem.detail}\n\nTake them as they are?`)) throw problem;
    return json(path + "?confirm=true");
  }
}
const say = (text) => { document.getElementById("say").textContent = text; };

/* The value of an input: in SI, with the digits that were typed; undefined where nothing was said. */
function valueOf(input) {
  if (input.type === "checkbox") return input.checked || undefined;
  if ("truth" in input.dataset) return { true: true, false: false, null: null }[input.value];
  const text = input.value.trim();
  if (text === "") return undefined;
  if ("pairs" in input.dataset) return Object.fromEntries(text.split("\n").filter((row) => row.trim()).map((row) => { const [key, ...rest] = row.split(":"); return [key.trim(), rest.join(":").trim()]; }));
  if ("scale" in input.dataset) return inSI(input, text);
  if (input.type === "number") return Number(text);
  if (input.type === "datetime-local") return new Date(text).toISOString();
  if ("numbers" in input.dataset) return text.split(/[\s,;]+/).map(Number);
  return text;
}
/* A number in the unit of its field, or with a unit of its own, such as "0.5 m" in a field of mm; NaN of what is neither. */
const UNIT_FACTORS = { m: 1, mm: 1e-3, cm: 1e-2, in: 0.0254, Pa: 1, kPa: 1e3, MPa: 1e6, GPa: 1e9, kg: 1, g: 1e-3 };
const LIKE = [["m", "mm", "cm", "in"], ["Pa", "kPa", "MPa", "GPa"], ["kg", "g"]];
const unitOf = (input) => /\[([^\]]+)\]/.exec(input.closest("label")?.firstChild?.textContent ?? "")?.[1];
function inSI(input, text) {
  const [, value, unit] = /^([-+]?[\d.]+(?:e[-+]?\d+)?)\s*([a-zA-Z]*)$/.exec(text.replace(",", ".")) ?? [];
  const like = LIKE.find((units) => units.includes(unitOf(input)));
  if (value === undefined || (unit && !like?.includes(unit))) return NaN;
  return Number((Number(value) * (unit ? UNIT_FACTORS[unit] : Number(input.dataset.scale))).toPrecision(15));
}
document.addEventListener("input", ({ target }) => {
  if (!target.dataset?.scale) return;
  const value = inSI(target, target.value.trim());
  target.setCustomValidity(target.value.trim() && Number.isNaN(value) ? `A number in ${unitOf(target)}, or with another unit of the same kind.` : "");
});
document.addEventListener("change", ({ target }) => { // what was typed with another unit stands in the field's own
  if (!target.dataset?.scale || !/[a-zA-Z]$/.test(target.value)) return;
  const value = inSI(target, target.value.trim());
  if (!Number.isNaN(value)) target.value = Number((value / Number(target.dataset.scale)).toPrecision(12));
});
function put(target, pointer, value) {
  const steps = pointer.split("/");
  let node = target;
  steps.slice(0, -1).forEach((step, i) => { node = node[step] ??= /^\d+$/.test(steps[i + 1]) ? [] : {}; });
  node[steps.at(-1)] = value;
}
function bodyOf(form) {
  const body = {};
  for (const input of form.elements) {
    if (!input.name || input.type === "file" || input.closest("template")) continue;
    if (input.name.endsWith("[]")) {
      const name = input.name.slice(0, -2);
      const list = body[name] ??= [];
      if (input.checked) list.push(input.value);
      continue;
    }
    const value = valueOf(input);
    if (value !== undefined) put(body, input.name, value);
  }
  return body;
}
function showFaults(form, problem) {
  for (const input of form.elements) input.removeAttribute?.("aria-invalid");
  const lines = [];
  let first = null;
  for (const fault of problem.errors ?? []) {
    const name = fault.pointer.replace(/^\//, "");
    const input = [...form.elements].find((e) => e.name === name || e.name === name + "[]" || (e.name && name.startsWith(e.name + "/")));
    const label = input?.closest("label")?.firstChild?.textContent?.trim();
    lines.push(`${label || fault.pointer}: ${fault.detail}`);
    if (input) {
      input.setAttribute("aria-invalid", "true");
      const closed = input.closest("details:not([open])");
      if (closed) closed.open = true;
      first ??= input;
    }
  }
  form.querySelector(".faults").textContent = lines.join("; ") || problem.detail || String(problem);
  first?.focus();
}
function goOn(then, value) {
  if (then === "reload") return location.reload();
  location.assign(at(then.replace("{id}", value?.id ?? "")));
}
async function submitted(form, work) {
  const button = form.querySelector("button[type=submit]");
  form.querySelector(".faults").textContent = "";
  button.disabled = true;
  try { await work(); } catch (problem) { showFaults(form, problem); } finally { button.disabled = false; }
}

document.addEventListener("submit", (event) => {
  const form = event.target;
  if (form.dataset.post) {
    event.preventDefault();
    submitted(form, async () => {
      const path = form.dataset.post.replace(/\{(\w+)\}/g, (_, name) => encodeURIComponent(form.elements[name].value.trim()));
      const body = bodyOf(form);
      for (const [, name] of form.dataset.post.matchAll(/\{(\w+)\}/g)) delete body[name];
      const made = "empty" in form.dataset && !form.dataset.post.endsWith("/runs") ? await call("POST", path) : await send(form.dataset.method ?? "POST", path, body);
      if ("showKey" in form.dataset) form.querySelector("output").textContent = `${made.key} – this is shown once; keep it now.`;
      else if ("showSecret" in form.dataset) form.querySelector("output").textContent = `${made.secret} – the secret is shown once; keep it now.`;
      else goOn(form.dataset.then, made);
    });
  } else if ("deck" in form.dataset) {
    event.preventDefault();
    submitted(form, () => sendDeck(form));
  } else if (form.dataset.delete) {
    event.preventDefault();
    if (confirm(form.dataset.confirm)) submitted(form, async () => { await call("DELETE", form.dataset.delete); goOn(form.dataset.then); });
  } else if ("signIn" in form.dataset) {
    event.preventDefault();
    submitted(form, async () => {
      await call("POST", "session", undefined, { Authorization: "Bearer " + form.elements.key.value.trim() });
      const next = new URLSearchParams(location.search).get("next") ?? "ui/";
      location.assign(at(/^(ui|api\/v1)\/[\w\-/?=&%.]*$/.test(next) ? next : "ui/"));
    });
  } else if ("newTest" in form.dataset) {
    event.preventDefault();
    submitted(form, () => newTest(form));
  } else if ("filter" in form.dataset) {
    event.preventDefault();
    const said = [...new FormData(form)].filter(([, value]) => value !== "");
    location.assign("?" + new URLSearchParams(said));
  } else if ("choose" in form.dataset) {
    event.preventDefault();
    const chosen = [...new FormData(form)].filter(([, value]) => value);
    if (chosen.length > 1) location.assign(form.action + "?" + new URLSearchParams(chosen));
    else say("Choose at least two to compare.");
  }
});

/* A whole test from one form. What was made before a fault is used again, so nothing is made twice. */
async function newTest(form) {
  const body = bodyOf(form);
  const made = form.made ??= {};
  const make = async (part, path) => {
    const text = path + JSON.stringify(body[part]);
    if (made[part]?.text === text) return made[part].id;
    try { made[part] = { text, id: (await send("POST", path, body[part])).id }; } catch (problem) {
      for (const fault of problem.errors ?? []) fault.pointer = `/${part}${fault.pointer}`;
      throw problem;
    }
    return made[part].id;
  };
  const project = body.project_id || (await make("project", "projects"));
  const structure = await make("structure", `projects/${project}/structures`);
  const campaign = await make("campaign", `structures/${structure}/campaigns`);
  const file = form.elements.file.files[0];
  if (file) await upload(`campaigns/${campaign}/imports`, file, form);
  location.assign(at(`ui/campaigns/${campaign}`));
}

const upload = (path, file, form) => {
  const stated = ["kind", "quantity", "mapping"].map((name) => [name, form.querySelector(`details [name=${name}]`)?.value.trim()]);
  const query = new URLSearchParams([["filename", file.name.slice(0, 200)], ...stated.filter(([, value]) => value)]);
  return call("POST", `${path}?${query}`, file, { "Content-Type": "application/octet-stream" });
};

/* A deck with its units; its reading is waited for on the structure's page. */
async function sendDeck(form) {
  const { file, units, accept } = form.elements;
  const query = new URLSearchParams([["filename", file.files[0].name.slice(0, 200)]]);
  if (units.value.trim()) query.set("units", units.value.trim());
  for (const card of accept.value.split(/[,;]+/)) if (card.trim()) query.append("accept", card.trim());
  await call("POST", `${form.dataset.deck}?${query}`, file.files[0], { "Content-Type": "application/octet-stream" });
  location.reload();
}

/* When all files of a campaign are read, its page is loaded anew: it has FRFs that it did not have. */
let sending = 0, stale = document.querySelector("#uploaded [hx-get]") !== null;
function refreshed() {
  const list = document.getElementById("uploaded");
  if (list && stale && !sending && !list.querySelector("[hx-get]")) location.reload();
}
document.addEventListener("htmx:afterSettle", refreshed);

async function uploadAll(form, files) {
  const list = document.getElementById("uploaded");
  sending += 1;
  form.querySelector(".faults").textContent = "";
  for (const file of files) {
    say(`Sending ${file.name} …`);
    try {
      const made = await upload(form.dataset.upload, file, form);
      if (made.already_imported) say(`${file.name} is in this campaign already.`); else say("");
      const holder = document.createElement("div");
      list.prepend(holder);
      await htmx.ajax("GET", at(form.dataset.then.replace("{id}", made.id)), { target: holder, swap: "outerHTML" });
      stale ||= !made.already_imported;
    } catch (problem) { say(""); showFaults(form, problem); }
  }
  sending -= 1;
  refreshed();
}
for (const zone of document.querySelectorAll(".drop")) {
  const input = zone.querySelector("input[type=file]");
  const form = zone.closest("form");
  const over = (on) => (event) => { event.preventDefault(); zone.classList.toggle("over", on); };
  zone.addEventListener("dragover", over(true));
  zone.addEventListener("dragleave", over(false));
  zone.addEventListener("drop", (event) => {
    over(false)(event);
    if (form.dataset.upload) uploadAll(form, event.dataTransfer.files);
    else input.files = event.dataTransfer.files;
  });
  if (form.dataset.upload) input.addEventListener("change", () => uploadAll(form, input.files));
}

document.addEventListener("click", async (event) => {
  const button = event.target.closest("button");
  if (!button) return;
  if ("signOut" in button.dataset) { await call("DELETE", "session"); location.assign(at("sign-in")); }
  if ("addRow" in button.dataset) addRow(button.closest("[data-rows]"));
  if ("dropRow" in button.dataset) { const rows = button.closest("[data-rows]"); button.closest(".one").remove(); number(rows); }
});
function addRow(rows, values = {}) {
  const row = rows.querySelector("template").content.cloneNode(true).firstElementChild;
  for (const input of row.querySelectorAll("[name]")) input.dataset.field = input.name;
  rows.querySelector("[data-add-row]").before(row);
  for (const [name, value] of Object.entries(values)) fill(row.querySelector(`[data-field="${name}"]`), value);
  number(rows);
  return row;
}
function number(rows) {
  [...rows.querySelectorAll(".one")].forEach((row, i) => {
    for (const input of row.querySelectorAll("[data-field]")) input.name = `${rows.dataset.rows}/${i}/${input.dataset.field}`;
  });
}
function fill(input, value) {
  if (!input) return;
  if (input.type === "checkbox") input.checked = Boolean(value);
  else input.value = Array.isArray(value) ? value.join(", ") : value;
  const closed = input.closest("details:not([open])");
  if (closed) closed.open = true;
}
/* A recipe that is repeated: its values put back into the form. */
for (const form of document.querySelectorAll("form[data-start]")) {
  const place = (value, pointer) => {
    const rows = form.querySelector(`[data-rows="${pointer}"]`);
    const boxes = form.querySelectorAll(`[name="${pointer}[]"]`);
    if (rows) value.forEach((row) => addRow(rows, row));
    else if (boxes.length) boxes.forEach((box) => { box.checked = value.includes(box.value); });
    else if (value && typeof value === "object" && !form.elements[pointer]) Object.entries(value).forEach(([key, inner]) => place(inner, pointer ? `${pointer}/${key}` : key));
    else fill(form.elements[pointer], value);
  };
  place(JSON.parse(form.dataset.start), "");
}
const project = document.getElementById("project");
if (project) {
  const named = new URLSearchParams(location.search).get("project");
  if (named && [...project.options].some((option) => option.value === named)) project.value = named;
  else if (project.options.length > 1) project.selectedIndex = 1;
  const name = document.getElementsByName("project/name")[0];
  const follow = () => { name.closest("label").hidden = project.value !== ""; name.required = project.value === ""; };
  project.addEventListener("change", follow);
  follow();
}
/* The part of a result that is in sight is the marked one. */
const tabs = [...document.querySelectorAll(".tabs a")];
if (tabs.length) {
  const mark = (id) => tabs.forEach((tab) => (tab.hash === "#" + id ? tab.setAttribute("aria-current", "true") : tab.removeAttribute("aria-current")));
  const seen = new IntersectionObserver((entries) => entries.forEach((e) => e.isIntersecting && mark(e.target.id)), { rootMargin: "-25% 0px -70% 0px" });
  tabs.forEach((tab) => seen.observe(document.querySelector(tab.hash)));
  mark(location.hash.slice(1).split("=")[0] || tabs[0].hash.slice(1));
}
