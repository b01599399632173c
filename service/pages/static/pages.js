"use strict";
/* What every page does: forms that speak REST with the session's token, files dropped in, the
   session itself. */
const page = document.documentElement.dataset;
const at = (path) => new URL(page.root + path, location.href).href;
const rest = (path) => at("api/v1/" + path);

async function call(method, path, body, headers = {}) {
  const answer = await fetch(rest(path), {
    method,
    body,
    headers: { Accept: "application/json", "X-CSRF-Token": page.csrf, ...headers },
  });
  return valueIn(answer.status, await answer.text());
}
function valueIn(status, text) {
  const value = text ? JSON.parse(text) : null;
  if (status === 401 && page.csrf)
    location.assign(
      at(
        "sign-in?next=" +
          encodeURIComponent(location.pathname.slice(new URL(at("")).pathname.length)),
      ),
    );
  if (status >= 400) throw value ?? { detail: `status ${status}` };
  return value;
}
const get = (path) =>
  call("GET", path).catch((problem) => {
    throw new Error(problem.detail ?? problem.message);
  });
/* Numbers that are probably in another unit are sent again where a person says that they are meant.
 */
async function meant(path, sent) {
  try {
    return await sent(path);
  } catch (problem) {
    if (
      !problem.confirmable ||
      !(await agreed(linesOf(speaking, problem).join("\n"), "Take them as they are"))
    )
      throw problem;
    return sent(path + "?confirm=true");
  }
}
const send = (method, path, value, headers = {}) =>
  meant(path, (to) =>
    call(method, to, JSON.stringify(value), { "Content-Type": "application/json", ...headers }),
  );

/* The value of an input: of a quantity what the service understood; undefined where nothing was
   said. */
function valueOf(input) {
  if (input.type === "checkbox") return input.checked || undefined;
  if ("truth" in input.dataset) return { true: true, false: false, null: null }[input.value];
  const text = input.value.trim();
  if (text === "") return "asked" in input.dataset ? null : undefined;
  if ("pairs" in input.dataset)
    return Object.fromEntries(
      text
        .split("\n")
        .filter((row) => row.trim())
        .map((row) => {
          const [key, ...rest] = row.split(":");
          return [key.trim(), rest.join(":").trim()];
        }),
    );
  if (kindOf(input)) return UNDERSTOOD.get(questionOf(input)).value;
  if ("list" in input.dataset)
    return text
      .split(",")
      .map((part) => part.trim())
      .filter(Boolean);
  if ("column" in input.dataset) return /^\d+$/.test(text) ? Number(text) : text; // of a file without headers its number
  if ("number" in input.dataset) return Number(text); // of a list or a hidden field
  if (input.type === "datetime-local") return new Date(text).toISOString();
  return text;
}
function put(target, pointer, value) {
  const steps = pointer.split("/");
  let node = target;
  steps.slice(0, -1).forEach((step, i) => {
    node = node[step] ??= /^\d+$/.test(steps[i + 1]) ? [] : {};
  });
  return (node[steps.at(-1)] = value);
}
function bodyOf(form) {
  const body = {},
    lists = {};
  for (const input of form.elements) {
    if (
      !input.name ||
      input.type === "file" ||
      input.matches(":disabled") ||
      input.closest("template")
    )
      continue;
    if (input.name.endsWith("[]")) {
      const name = input.name.slice(0, -2);
      const list = (lists[name] ??= put(body, name, []));
      if (input.checked) list.push(input.value);
      continue;
    }
    const value = valueOf(input);
    if (value !== undefined) put(body, input.name, value);
  }
  return body;
}
/* Where the faults of a form stand: above the button that sends it. */
function faultsOf(form) {
  const place = form.querySelector(".faults") ?? made("p", { className: "faults", role: "alert" });
  if (place.isConnected) return place;
  const button = form.querySelector(":scope > .actions, button[type=submit]");
  if (button) button.before(place);
  else form.append(place);
  return place;
}
function showFaults(form, problem) {
  for (const input of form.elements) input.removeAttribute?.("aria-invalid");
  const wrong = (problem.errors ?? [])
    .map(({ pointer }) => inputOf(form, pointer.replace(/^\//, "")))
    .filter(Boolean);
  for (const input of wrong) {
    input.setAttribute("aria-invalid", "true");
    const closed = input.closest("details:not([open])");
    if (closed) closed.open = true;
  }
  faultsOf(form).textContent = linesOf(form, problem).join("; ");
  wrong[0]?.focus();
}
/* To another page, or to this one anew: until it comes, no button sends again what was sent. */
let leaving = false;
/* What was deleted and kept can be had back at once. */
const KEPT = /^(projects|structures|campaigns|monitors|instruments)\/[^/]+$/;
function offerUndo() {
  const done = sessionStorage.getItem("done");
  sessionStorage.removeItem("done");
  if (done) say(done);
  const path = sessionStorage.getItem("deleted");
  if (!path) return;
  sessionStorage.removeItem("deleted");
  say(`The ${path.split("s/")[0]} was deleted.`, async () => {
    await call("POST", `${path}/restore`);
    leave();
  });
}
function leave(to = null) {
  leaving = true;
  page.leaving = "";
  if (to === null) location.reload();
  else location.assign(at(to));
}
const goOn = (then = "reload", value = null) =>
  leave(then === "reload" ? null : then.replace("{id}", (value?.joint ?? value)?.id ?? ""));
async function submitted(form, work) {
  const button = form.querySelector("button[type=submit]");
  faultsOf(form).textContent = "";
  button.disabled = true;
  speaking = form;
  try {
    await understand(form);
    await work();
  } catch (problem) {
    showFaults(form, problem);
  }
  const again = () => {
    leaving = button.disabled = false;
    delete page.leaving;
  };
  if (leaving) addEventListener("pagehide", again, { once: true });
  else again(); // a browser may bring the page back as it was
}

/* What a form does that says so; a button sends nothing twice, and faults stand in the form. */
const WORK = {
  async post(form) {
    const { post, empty, method = "POST", showKey, showSecret, then } = form.dataset;
    const body = bodyOf(form);
    const path = post.replace(/\{(\w+)\}/g, (_, name) => {
      delete body[name];
      return encodeURIComponent(form.elements[name].value.trim());
    });
    const bare = empty !== undefined && !post.endsWith("/runs");
    const made = bare ? await call("POST", path) : await send(method, path, body);
    const once = showKey !== undefined ? made.key : showSecret !== undefined && made.secret;
    if (once)
      form.querySelector("output").textContent = `${once} – this is shown once; keep it now.`;
    else goOn(then, made);
  },
  read: (form) => ("again" in form.dataset ? lookAgain(form, []) : readSo(form)),
  async points(form) {
    await send("PUT", form.dataset.points, { items: bodyOf(form).points ?? [] });
    leave();
  },
  async deck(form) {
    await sendDeck(form, form.dataset.deck);
    leave();
  },
  async delete({ dataset: { delete: path, confirm, then } }, button) {
    if (confirm && !(await agreed(confirm, button?.textContent))) return;
    await call("DELETE", path);
    if (KEPT.test(path)) sessionStorage.setItem("deleted", path);
    goOn(then);
  },
  async signIn(form) {
    const key = form.elements.key.value.trim();
    await call("POST", "session", undefined, { Authorization: "Bearer " + key });
    const next = new URLSearchParams(location.search).get("next") ?? "ui/";
    leave(/^(ui|api\/v1)\/[\w\-/?=&%.]*$/.test(next) ? next : "ui/");
  },
  newTest,
  example: addExample,
};
document.addEventListener("submit", (event) => {
  const { target: form, submitter } = event;
  const name = Object.keys(WORK).find((each) => each in form.dataset);
  const chosen = [...new FormData(form)].filter(([, value]) => value !== "");
  if (!name && !("filter" in form.dataset || "choose" in form.dataset)) return;
  event.preventDefault();
  if (name) submitted(form, () => WORK[name](form, submitter));
  else if ("choose" in form.dataset && chosen.length < 2) say("Choose at least two to compare.");
  else {
    const to = submitter?.getAttribute("formaction") ?? form.getAttribute("action") ?? "";
    location.assign(to + "?" + new URLSearchParams(chosen));
  }
});

/* Arrays of a file that does not say what they are are only looked at first: the report asks for
   what is missing. */
const upload = (path, file, form) => {
  const quantity = form.querySelector("details [name=quantity]")?.value;
  const lookedAt = form.elements.file.dataset.lookedAt.trim().split(" ");
  return sendFile(
    path,
    file,
    file.name,
    lookedAt.some((suffix) => file.name.toLowerCase().endsWith(suffix))
      ? [["dry_run", "true"]]
      : quantity
        ? [["quantity", quantity]]
        : [],
  );
};
/* A file that was looked at is read as its form says, with others that have its arrays where that
   is wished. */
async function sendAgain({ read, into, name }, stated) {
  const original = await fetch(rest(`imports/${read}/original`));
  return sendFile(into, await original.blob(), name, stated);
}
/* The report on an import, in the place of an element, whose request it is: of several that one
   element waits to send, htmx sends the last. */
const report = (id, target) =>
  htmx.ajax("GET", at(`ui/imports/${id}?part=1`), { source: target, target, swap: "outerHTML" });
async function lookAgain(form, stated) {
  const { id } = await sendAgain(form.dataset, [["dry_run", "true"], ...stated]);
  if (uploaded) await report(id, form.closest(".import"));
  else leave();
}
document.addEventListener("change", ({ target }) => {
  // what its arrays are decides what is asked of it
  if ("look" in target.dataset && target.form.dataset.read)
    submitted(target.form, () => lookAgain(target.form, [["kind", target.value]]));
});
const alike = (form) =>
  [...document.querySelectorAll("form[data-arrays]")].filter(
    (other) => other !== form && other.dataset.arrays === form.dataset.arrays,
  );
function statedIn(form) {
  const aside = form.querySelector("[data-aside]");
  const { [aside?.name]: said, ...mapping } = bodyOf(form);
  const stated = said ? [[aside.name, said]] : [];
  if (Object.keys(mapping).length) stated.push(["mapping", JSON.stringify(mapping)]);
  return stated;
}
const readAs = new Map(); // imports, and the sections that asked how to read them
async function readSo(form) {
  const stated = statedIn(form);
  for (const { dataset, parentElement: section } of [
    form,
    ...(form.querySelector("[data-alike]").checked ? alike(form) : []),
  ]) {
    const { id } = await sendAgain(dataset, stated);
    stale = true;
    readAs.set(id, section);
    if (uploaded) await reportBefore(section, id);
  }
  if (!uploaded) leave(`ui/${form.dataset.into.replace(/\/imports$/, "")}`);
}
/* A report that comes before another, or first. */
function reportBefore(other, id) {
  const place = made("div");
  place.dataset.awaited = "";
  if (other) other.before(place);
  else uploaded.append(place);
  return report(id, place);
}

/* When all files of a campaign are read, their list and the tabs are those of now; what is in the
   other parts is loaded when one of them is opened. */
const uploaded = document.getElementById("uploaded");
let sending = 0,
  stale = uploaded?.querySelector("[data-awaited]") != null;
async function renewFiles() {
  for (const [id, asked] of readAs)
    if (document.querySelector(`#import-${id} .state.succeeded`)) asked.remove();
  if (!stale || sending || leaving || uploaded.querySelector("[data-awaited]")) return;
  stale = false;
  if (document.getElementById("files").hidden) return renew();
  const answer = await fetch(location.pathname);
  const next = new DOMParser().parseFromString(await answer.text(), "text/html");
  document.querySelector(".tabs").innerHTML = next.querySelector(".tabs").innerHTML;
  document.querySelector("#files > .scroll")?.remove();
  uploaded.after(...next.querySelectorAll("#files > .scroll"));
  history.replaceState(null, "", location.pathname + location.search + "#files");
  document.querySelector(".tabs [href='#files']").setAttribute("aria-current", "page");
  addEventListener("hashchange", () => leave(), { once: true });
  watch();
}
document.addEventListener("htmx:beforeSwap", ({ detail }) => {
  if (leaving) detail.shouldSwap = false;
});
document.addEventListener("htmx:afterSettle", renewFiles);
document.addEventListener("htmx:afterSettle", begin);

async function uploadAll(form, files) {
  sending += files.length;
  faultsOf(form).textContent = "";
  for (const file of files) {
    try {
      const sent = await upload(form.dataset.upload, file, form).finally(() => {
        sending -= 1;
      });
      if (sent.already_imported) say(`${file.name} is in this campaign already.`);
      else say("");
      stale ||= !sent.already_imported;
      await reportBefore(uploaded.firstChild, sent.id);
    } catch (problem) {
      say("");
      showFaults(form, problem);
    }
  }
  renewFiles();
}
document.addEventListener("change", ({ target }) => {
  if (target.type === "file" && target.form?.dataset.upload)
    uploadAll(target.form, [...target.files]);
});

document.addEventListener("click", async (event) => {
  const button = event.target.closest("button");
  if (!button) return;
  if ("signOut" in button.dataset) {
    await call("DELETE", "session");
    location.assign(at("sign-in"));
  }
  if ("addRow" in button.dataset) addRow(button.closest("[data-rows]"));
  if ("sameBelow" in button.dataset) sameBelow(button.closest(".one"));
  if ("dropRow" in button.dataset) {
    const rows = button.closest("[data-rows]");
    button.closest(".one").remove();
    number(rows);
  }
});
function addRow(rows, values = {}) {
  const row = rows.querySelector("template").content.cloneNode(true).firstElementChild;
  for (const input of row.querySelectorAll("[name]")) input.dataset.field = input.name;
  rows.querySelector("[data-add-row]").before(row);
  for (const [name, value] of Object.entries(values))
    fill(row.querySelector(`[data-field="${name}"]`), value);
  number(rows);
  return row;
}
/* What is said of a channel but array and point, for those below of its quantity or of none. */
function sameBelow(row) {
  const at = (one, name) => one.querySelector(`[data-field=${name}]`);
  const quantity = at(row, "quantity").value;
  for (let next = row; (next = next.nextElementSibling)?.matches(".one"); ) {
    if (!["", quantity].includes(at(next, "quantity").value)) continue;
    for (const { dataset, value } of row.querySelectorAll("[data-field]"))
      if (!/variable|point/.test(dataset.field)) at(next, dataset.field).value = value;
  }
}
function number(rows) {
  [...rows.querySelectorAll(".one")].forEach((row, i) => {
    for (const input of row.querySelectorAll("[data-field]"))
      input.name = `${rows.dataset.rows}/${i}/${input.dataset.field}`;
  });
}
/* A number of REST in the unit of its field. */
const inUnit = (input, value) =>
  input.dataset.scale ? Number((value / Number(input.dataset.scale)).toPrecision(15)) : value;
/* A time as a field of a form shows it, of the clock here. */
const localTime = (text) => {
  const at = new Date(text);
  return new Date(at - 60_000 * at.getTimezoneOffset()).toISOString().slice(0, 16);
};
const lineOf = (item) => (typeof item === "string" ? item : JSON.stringify(item));
/* What REST says as a field shows it. */
function shownIn(input, value) {
  if ("pairs" in input.dataset)
    return Object.entries(value)
      .map(([key, item]) => `${key}: ${lineOf(item)}`)
      .join("\n");
  if (input.type === "datetime-local") return localTime(value);
  return [value]
    .flat()
    .filter((one) => one !== null)
    .map((one) => one?.variable ?? inUnit(input, one))
    .join("list" in input.dataset ? ", " : "; ");
}
function fill(input, value) {
  if (!input) return;
  if (input.type === "checkbox") input.checked = Boolean(value);
  else input.value = shownIn(input, value);
  const closed = input.closest("details:not([open])");
  if (closed) closed.open = true;
}
/* Forms that come with values: a recipe that is repeated, an example, a proposed mapping; and those
   that need none. */
function begin() {
  for (const form of document.querySelectorAll("form[data-start]:not([data-begun])")) {
    form.dataset.begun = "";
    const place = (value, pointer) => {
      const rows = form.querySelector(`[data-rows="${pointer}"]`);
      const boxes = form.querySelectorAll(`[name="${pointer}[]"]`);
      if (rows && Array.isArray(value)) value.forEach((row) => addRow(rows, row));
      else if (boxes.length)
        boxes.forEach((box) => {
          box.checked = value.includes(box.value);
        });
      else if (value && typeof value === "object" && !form.elements[pointer])
        Object.entries(value).forEach(([key, inner]) =>
          place(inner, pointer ? `${pointer}/${key}` : key),
        );
      else fill(form.elements[pointer], value);
    };
    place(JSON.parse(form.dataset.start), "");
  }
  for (const kind of document.querySelectorAll("select[data-kind]:not([data-begun])")) {
    kind.dataset.begun = "";
    followKind(kind);
  }
  for (const form of document.querySelectorAll("form[data-arrays]:has([data-alike])")) {
    requireMissing(form);
    const label = form.querySelector("label:has([data-alike])"),
      others = alike(form).map((other) => other.dataset.name);
    label.hidden = !others.length;
    label.querySelector("span").textContent = `Read ${others.join(", ")} so, too`;
  }
  if (!sending)
    for (const form of document.querySelectorAll("form[data-at-once]")) {
      delete form.dataset.atOnce;
      submitted(form, () => readSo(form));
    }
}
/* What a mapping still lacks: where the hits are in turn, the force needs no place; samples in a
   unit of their own no sensitivity. */
function requireMissing(form) {
  const inTurn = form.querySelector("[data-kind]:not([hidden])")?.value,
    listed = form.querySelector("[name^='recording/order/']");
  for (const row of form.querySelectorAll("[data-rows=channels] .one")) {
    const at = (name) => row.querySelector(`[data-field=${name}]`),
      isForce = at("quantity").value === "force";
    at("point").required = !(isForce && ((inTurn === "order" && listed) || inTurn === "filename"));
    at("direction").required = !(isForce && inTurn === "order" && listed);
    at("sensitivity").required = /^(m?v)?$/i.test(at("unit").value.trim());
  }
}
for (const name of ["input", "change", "click"])
  document.addEventListener(name, ({ target }) => {
    const form = target.closest?.("form[data-arrays]");
    if (form) requireMissing(form);
  });
/* Of a form the parts that a choice leaves out are neither seen nor sent nor asked for. */
function leaveOut(part, out) {
  part.hidden = out;
  for (const input of part.querySelectorAll("input, select, textarea"))
    input.disabled = [...input.form.querySelectorAll("[data-for], [data-new]")].some(
      (each) => each.hidden && each.contains(input),
    );
}
function followKind(kind) {
  const follow = () => {
    for (const part of kind.form.querySelectorAll("[data-for]"))
      part.hidden = !part.dataset.for.split(" ").includes(kind.value);
    for (const part of kind.form.querySelectorAll("[data-for]")) leaveOut(part, part.hidden);
    for (const input of kind.form.querySelectorAll("[data-follows]")) input.value = kind.value;
  };
  kind.addEventListener("change", follow);
  const asked = kind.form.dataset.kind;
  if (asked) kind.value = asked;
  follow();
}
begin();
beginNewTest();
offerUndo();
