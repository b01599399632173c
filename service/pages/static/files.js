"use strict";
/* Files: chosen or dropped, looked at before a test is made of them, on their way, and read. */
const pause = () =>
  new Promise((done) => {
    setTimeout(done, 500);
  });
/* What a service answers to a file; meanwhile a line says how far it is, and takes it back. */
async function answerTo(address, file, name) {
  const request = new XMLHttpRequest();
  const bar = made("progress", { value: 0, ariaLabel: name });
  const onclick = () => request.abort();
  const cancel = made("button", { className: "plain", type: "button", onclick }, "Cancel");
  const line = made("p", { className: "live" }, `Sending ${name}`, bar, cancel);
  document.querySelector(".drop")?.after(line);
  request.upload.addEventListener("progress", ({ loaded, total }) => {
    bar.value = loaded / total;
  });
  try {
    await new Promise((done, failed) => {
      request.open("POST", address);
      request.setRequestHeader("Accept", "application/json");
      request.setRequestHeader("X-CSRF-Token", page.csrf);
      request.setRequestHeader("Content-Type", "application/octet-stream");
      request.onload = done;
      request.onerror = () => failed({ detail: `${name}: the connection broke.` });
      request.onabort = () => failed({ detail: `${name} was not sent.` });
      request.send(file);
    });
  } finally {
    line.remove();
  }
  return { status: request.status, text: request.responseText };
}
async function sendFile(path, file, name, stated) {
  const query = new URLSearchParams([["filename", name.slice(0, 200)], ...stated]);
  const { status, text } = await answerTo(rest(`${path}?${query}`), file, name);
  return valueIn(status, text);
}
/* A job when it has ended; its stage is said meanwhile. */
async function ended(path, words) {
  for (;;) {
    const job = await call("GET", path);
    if (!["queued", "running"].includes(job.status)) {
      say("");
      if (job.status !== "succeeded") throw { detail: job.message };
      return job;
    }
    say(`${words}${job.stage ? `: ${job.stage}` : ""} …`);
    await pause();
  }
}

/* Places for files: what lies in one is named, and is what was dropped there. */
document.addEventListener("change", ({ target }) => {
  const name = target.type === "file" && target.closest(".drop")?.querySelector("output");
  if (name) name.textContent = [...target.files].map((file) => file.name).join(", ");
});
for (const name of ["dragover", "dragleave", "drop"])
  document.addEventListener(name, (event) => {
    const zone = event.target.closest?.(".drop");
    if (!zone) return;
    event.preventDefault();
    zone.classList.toggle("over", name === "dragover");
    if (name !== "drop") return;
    const input = zone.querySelector("input");
    input.files = event.dataTransfer.files;
    input.dispatchEvent(new Event("change", { bubbles: true }));
  });

/* A deck with its units. */
function sendDeck(form, structure) {
  const { deck, units, accept, sections } = form.elements;
  const query = new URLSearchParams([["filename", deck.files[0].name.slice(0, 200)]]);
  for (const one of [units, sections]) if (one.value.trim()) query.set(one.name, one.value.trim());
  for (const card of accept.value.split(/[,;]+/))
    if (card.trim()) query.append("accept", card.trim());
  return call("POST", `structures/${structure}/model?${query}`, deck.files[0], {
    "Content-Type": "application/octet-stream",
  });
}

/* A new test. Files are looked at by the service, which stores nothing of them; the form is filled
   in with what they state. Those with the same arrays have one mapping. */
const looked = []; // file, facts, row, and the form of its mapping
const newForm = () => document.querySelector("form[data-new-test]");
async function lookAt(file, kind = "") {
  const query = new URLSearchParams({ filename: file.name.slice(0, 200) });
  if (kind) query.set("kind", kind);
  const { status, text } = await answerTo(at(`ui/files?${query}`), file, file.name);
  if (status >= 400) throw { detail: `${file.name} could not be looked at; try again.` };
  const { content } = made("template", { innerHTML: text });
  const row = content.querySelector("tr");
  const asked = content.querySelector("form");
  const facts = JSON.parse(row.dataset.facts);
  const place = document.querySelector("[data-mappings]");
  const before = looked.findIndex((each) => each.file.name === file.name);
  if (before >= 0) leaveOutFile(looked[before]);
  let mapping = asked;
  if (asked) {
    mapping = [...place.children].find((one) => one.dataset.arrays === asked.dataset.arrays);
    if (mapping) mapping.querySelector("h3").append(`, ${file.name}`);
    else {
      mapping = asked;
      asked.prepend(made("h3", {}, `What is in ${file.name}`));
      asked.className = "card asks";
      place.append(asked);
    }
  }
  looked.push({ file, facts, row, mapping });
  document.querySelector("[data-looked] tbody").append(row);
}
function leaveOutFile(one) {
  looked.splice(looked.indexOf(one), 1);
  one.row.remove();
  if (one.mapping && !looked.some(({ mapping }) => mapping === one.mapping)) one.mapping.remove();
}
const measuredOnes = () => looked.filter(({ facts }) => !facts.refused && !facts.model && !facts.only_points);
/* What files state stands in the fields, and says where it is from. */
function stateFacts() {
  const form = newForm();
  for (const { facts } of looked)
    for (const [name, value] of Object.entries(facts)) {
      const input = name.includes("/") && form.elements[name];
      if (!input || !value || input.value) continue;
      fill(input, value);
      input.after(made("small", { className: "stated" }, `from ${facts.name}`));
    }
  for (const { facts } of looked) offerPoints(form, facts);
  const model = looked.find(({ facts }) => facts.model && !facts.refused);
  const { deck, units } = form.elements;
  if (model && deck.files[0] !== model.file) {
    const { asks_units: asked, fits } = model.facts;
    if (fits) offer(units, [[`Take ${fits}, which fit`, () => fill(units, fits)]]);
    const held = new DataTransfer();
    held.items.add(model.file);
    deck.files = held.files;
    deck.dispatchEvent(new Event("change", { bubbles: true }));
    const kind = form.querySelector("select[data-kind]");
    kind.value = "deck";
    kind.dispatchEvent(new Event("change", { bubbles: true }));
    units.required = asked;
  }
}
/* What a file suggests for a field stands below it, in place of what another one did; a click takes
   it. */
function offer(input, ways) {
  input.closest("label").querySelector(".offer")?.remove();
  const take = ([words, does]) => {
    const onclick = () => {
      does();
      input.dispatchEvent(new Event("input", { bubbles: true }));
    };
    return made("button", { type: "button", className: "plain", onclick }, words);
  };
  input.after(made("span", { className: "offer" }, ...ways.map(take)));
}
const sixDigits = (value) => Number(short(value, 6));
function offerPoints(form, { name, offers = [], reach_mm: reach }) {
  const { points } = form.elements;
  if (reach) offerSize(form, name, reach);
  const ways = offers.flatMap(({ array, labels, places, millimetres, reach: own }) =>
    Object.entries(millimetres).map(([unit, size]) => [
      `Take the ${labels.length} points of ${array} in ${name}, in ${unit}`,
      () => {
        const line = (place, i) => [labels[i], ...place.map((x) => sixDigits(x * size))].join("; ");
        fill(points, places.map(line).join("\n"));
        offerSize(form, array, own.map((x) => x * size));
      },
    ]),
  );
  if (ways.length) offer(points, ways);
}
function offerSize(form, name, reach) {
  const [length, width] = reach.map(sixDigits);
  if (!length || !width) return;
  for (const at of ["geometry", "shape"])
    offer(form.elements[`structure/${at}/length_m`], [
      [
        `Take ${length} × ${width} mm, as far as the points of ${name} reach`,
        () => {
          form.elements[`structure/${at}/length_m`].value = length;
          form.elements[`structure/${at}/width_m`].value = width;
        },
      ],
    ]);
}
/* Points are asked for where no file has them and the update needs them; the button counts what is
   missing. */
function askMissing() {
  const form = newForm();
  if (!form) return;
  const files = measuredOnes();
  const then = form.querySelector("[data-then]");
  const points = files.some(({ facts }) => facts.points || facts.large);
  const bare = form.querySelector("select[data-kind]").value === "bare" && !form.elements.structure_id.value;
  document.querySelector("[data-looked]").hidden = !looked.length;
  then.hidden = !files.length || bare;
  form.querySelector("[data-points]").hidden = points;
  form.elements.points.required = Boolean(files.length) && !points && thenUpdate(form);
  const missing = document.querySelectorAll(".asks :is(input, select, textarea):required:invalid");
  const sent = looked.filter(({ facts }) => !facts.refused && !facts.only_points).length;
  form.querySelector("[type=submit]").textContent =
    (files.length ? `Import ${sent} file${sent === 1 ? "" : "s"}` : "Store the test") +
    (looked.length && missing.length ? `: ${missing.length} missing` : "");
}
const thenUpdate = (form) => {
  const then = form.querySelector("[data-then]");
  return !then.hidden && then.querySelector("input").checked;
};
for (const name of ["input", "change", "click"])
  document.addEventListener(name, () => queueMicrotask(askMissing));

async function lookAtAll(files) {
  if (!newForm()) await openNewTest();
  const form = newForm();
  faultsOf(form).textContent = "";
  try {
    for (const file of files) await lookAt(file);
  } catch (problem) {
    showFaults(form, problem);
  }
  begin();
  stateFacts();
  askMissing();
}
/* The page of a new test in the place of this one, which has the files. */
async function openNewTest() {
  const address = at("ui/new");
  const answer = await fetch(address);
  const next = new DOMParser().parseFromString(await answer.text(), "text/html");
  document.title = next.title;
  document.querySelector("main").replaceChildren(...next.querySelector("main").childNodes);
  history.pushState(null, "", address);
  addEventListener("popstate", () => location.reload(), { once: true });
  beginNewTest();
}
document.addEventListener("change", ({ target }) => {
  if ("lookAt" in target.dataset) lookAtAll([...target.files]);
  if (!newForm()) return;
  if ("look" in target.dataset && target.closest("[data-mappings]")) {
    const same = looked.filter(({ mapping }) => mapping === target.form);
    submitted(newForm(), async () => {
      for (const { file } of same) await lookAt(file, target.value);
      begin();
      askMissing();
    });
  }
  if ("material" in target.dataset && target.value) takeMaterial(newForm(), target.value);
});
document.addEventListener("click", ({ target }) => {
  if (!("leaveOut" in target.dataset)) return;
  leaveOutFile(looked.find(({ row }) => row.contains(target)));
});
const ALIKE = {
  Ex_Pa: "E1_Pa",
  Ey_Pa: "E2_Pa",
  Gxy_Pa: "G12_Pa",
  Gxz_Pa: "G13_Pa",
  Gyz_Pa: "G23_Pa",
  nu_xy: "nu_12",
};
/* The material of another structure, whether that is a plate or has walls. */
async function takeMaterial(form, key) {
  const { material, shape, density_kg_m3: density } = await call("GET", `structures/${key}`);
  const found = material ?? shape.material;
  fill(form.elements["structure/density_kg_m3"], density);
  for (const [plate, wall] of Object.entries(ALIKE))
    for (const name of [`material/${plate}`, `shape/material/${wall}`])
      fill(form.elements[`structure/${name}`], found[plate] ?? found[wall]);
  askMissing();
}

/* What was made before a fault is used again, so nothing is made twice. */
async function newTest(form) {
  const mappings = looked.map(({ mapping }) => mapping).filter(Boolean);
  if (![form, ...mappings].every((each) => each.reportValidity())) return undefined;
  for (const mapping of mappings) await understand(mapping);
  const body = bodyOf(form);
  const stored = (form.stored ??= {});
  const make = async (part, path) => {
    const text = path + JSON.stringify(body[part]);
    if (stored[part]?.text === text) return stored[part].id;
    try {
      stored[part] = { text, id: (await send("POST", path, body[part])).id };
    } catch (problem) {
      for (const fault of problem.errors ?? []) fault.pointer = `/${part}${fault.pointer}`;
      throw problem;
    }
    return stored[part].id;
  };
  const structure = body.structure_id || (await newStructure(form, body, make));
  const campaign = await make("campaign", `structures/${structure}/campaigns`);
  if (body.points) await send("PUT", `campaigns/${campaign}/grid-points`, { items: body.points });
  const files = measuredOnes();
  const then = files.length && thenUpdate(form);
  for (const one of files) {
    const stated = one.mapping ? statedIn(one.mapping) : [];
    const text = campaign + JSON.stringify(stated);
    if (one.sent === text) continue;
    try {
      const into = `campaigns/${campaign}/imports`;
      const { id } = await sendFile(into, one.file, one.file.name, stated);
      if (then) await ended(`imports/${id}`, `Reading ${one.file.name}`);
    } catch (problem) {
      if (!one.mapping) throw problem;
      showFaults(one.mapping, problem);
      throw { detail: `${one.file.name} was not read; see above.` };
    }
    one.sent = text;
  }
  if (!then) return leave(`ui/campaigns/${campaign}`);
  const recipe = {};
  if (files.every(({ facts }) => facts.has_only_modes))
    recipe.mode_set = (await call("GET", `campaigns/${campaign}/mode-sets`)).items.at(-1).id;
  const { id } = await send("POST", `campaigns/${campaign}/update-jobs`, recipe);
  return leave(`ui/update-jobs/${id}`);
}
async function newStructure(form, body, make) {
  const project = body.project_id || (await make("project", "projects"));
  const structure = await make("structure", `projects/${project}/structures`);
  if (!form.elements.deck.matches(":disabled"))
    await ended(`models/${(await sendDeck(form, structure)).id}`, "Reading the deck");
  return structure;
}
function beginNewTest() {
  const form = newForm();
  if (!form) return;
  begin();
  const { project_id: project, structure_id: structure } = form.elements;
  const named = new URLSearchParams(location.search).get("project");
  if (named && [...project.options].some((option) => option.value === named)) project.value = named;
  else if (project.options.length > 1) project.selectedIndex = 1;
  const name = form.elements["project/name"];
  const follow = () => {
    for (const part of form.querySelectorAll("[data-new]")) leaveOut(part, structure.value !== "");
    name.closest("label").hidden = project.value !== "";
    name.disabled ||= project.value !== "";
  };
  for (const list of [structure, project]) list.addEventListener("change", follow);
  follow();
}
/* The example: what a newcomer would send, in the order of a test. */
async function addExample({ dataset }) {
  const { project, structure, campaign, modes, batch } = JSON.parse(dataset.example);
  const file = await (await fetch(at(dataset.file))).blob();
  const make = async (path, body) => (await send("POST", path, body)).id;
  say("Making the example …");
  const plate = await make(`projects/${await make("projects", project)}/structures`, structure);
  const test = await make(`structures/${plate}/campaigns`, campaign);
  const { id } = await sendFile(`campaigns/${test}/imports`, file, "paper_beam.uff", []);
  const recipe = {
    mode_set: await make(`campaigns/${test}/mode-sets`, modes),
    prior_from_coupon_batch: await make(`structures/${plate}/coupon-batches`, batch),
  };
  await ended(`imports/${id}`, "Reading the FRFs");
  leave(`ui/update-jobs/${await make(`campaigns/${test}/update-jobs`, recipe)}`);
}
/* Enter in a mapping sends the test. */
document.addEventListener("submit", (event) => {
  if (!("mapping" in event.target.dataset)) return;
  event.preventDefault();
  newForm().requestSubmit();
});
