"use strict";
/* What the kit's parts do: what is shown stands in the address; tabs, panes, tables, menus,
   questions and what was said. */
const shown = new URLSearchParams(location.search);
function keep(changes) {
  for (const [key, value] of Object.entries(changes))
    if (value === null) shown.delete(key);
    else shown.set(key, value);
  const query = shown.toString();
  history.replaceState(null, "", location.pathname + (query && "?" + query) + location.hash);
}
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const tell = (name, detail) => document.dispatchEvent(new CustomEvent(name, { detail }));
const hear = (name, does) => document.addEventListener(name, ({ detail }) => does(detail));

/* An element with its properties, and what is in it. */
const made = (tag, properties = {}, ...inside) => {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...inside);
  return element;
};
/* The same of a drawing, at the end of its parent. */
function drawn(parent, name, attributes, text = "") {
  const element = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.textContent = text;
  parent.append(element);
  return element;
}
const short = (value, digits = 7) => String(Number(value.toPrecision(digits)));
/* A line at the bottom; with what takes back what it tells of. */
function say(text, undo = null) {
  const place = document.getElementById("say");
  place.textContent = text;
  if (!undo) return;
  const onclick = () => {
    place.textContent = "";
    undo();
  };
  place.append(made("button", { onclick }, "Undo"));
}
/* Whether somebody agrees; Escape and the first button are no. */
function agreed(question, yes = "Yes") {
  const actions = made(
    "form",
    { className: "actions", method: "dialog" },
    made("button", { className: "plain", value: "" }, "Cancel"),
    made("button", { value: "yes" }, yes),
  );
  const dialog = made("dialog", {}, question, actions);
  document.body.append(dialog);
  dialog.showModal();
  return new Promise((done) => {
    dialog.addEventListener("close", () => {
      dialog.remove();
      done(dialog.returnValue === "yes");
    });
  });
}

/* Menus close where one goes on elsewhere. */
for (const name of ["click", "focusin"])
  document.addEventListener(name, ({ target }) => {
    for (const menu of document.querySelectorAll(".menu[open]"))
      if (!menu.contains(target)) menu.open = false;
  });
document.addEventListener("keydown", ({ key }) => {
  const menu = key === "Escape" && document.activeElement?.closest(".menu[open]");
  if (menu) {
    menu.open = false;
    menu.querySelector("summary").focus();
  }
});

/* One within what scrolls would be cut off: it stands over the page, below its head. */
document.addEventListener(
  "toggle",
  ({ target: menu }) => {
    if (!menu.open || !menu.matches(":is(.fill, .scroll) .menu")) return;
    const { left, bottom } = menu.firstElementChild.getBoundingClientRect();
    const { style, offsetWidth, offsetHeight } = menu.lastElementChild;
    style.left = `${Math.max(8, Math.min(left, innerWidth - offsetWidth - 8))}px`;
    style.top = `${Math.max(8, Math.min(bottom + 4, innerHeight - offsetHeight - 56))}px`;
  },
  true,
);

/* Tabs. Of a page: an address ends in the part that is seen, or in what is within it. Of a pane:
   one of the parts that follow its bar is seen. */
const tabs = [...document.querySelectorAll(".tabs > div:first-child a")];
const parts = tabs.map((tab) => document.querySelector(tab.hash));
function seePart() {
  if (!tabs.length) return;
  const named = location.hash.length > 1 && document.getElementById(location.hash.slice(1));
  const { first } = document.querySelector(".tabs").dataset;
  const part =
    parts.find((each) => named && each.contains(named)) ??
    parts.find((each) => each.id === first) ??
    parts[0];
  parts.forEach((each, i) => {
    each.hidden = each !== part;
    if (each === part) {
      tabs[i].setAttribute("aria-current", "page");
      tabs[i].scrollIntoView({ block: "nearest", inline: "center" });
    } else tabs[i].removeAttribute("aria-current");
  });
  const pane = named && named.closest(".pane");
  if (pane) seePane(pane);
  const inner = named && named.closest("[data-part]");
  if (inner) seeInner(inner.dataset.part);
  if (named && named !== part && !pane) named.scrollIntoView();
}
function seeInner(name) {
  const chosen = document.querySelector(`.bar [data-tab="${name}"]`);
  const pane = chosen.closest(".pane");
  for (const tab of pane.querySelectorAll("[data-tab]"))
    tab.setAttribute("aria-pressed", String(tab === chosen));
  for (const part of pane.querySelectorAll("[data-part]"))
    part.hidden = !part.dataset.part.split(" ").includes(name);
}
document.addEventListener("click", ({ target }) => {
  const tab = target.closest?.("[data-tab]");
  if (!tab) return;
  seeInner(tab.dataset.tab);
  keep({ t: tab.matches(":first-of-type") ? null : tab.dataset.tab });
});

/* Panes: lines between them move, by hand or by arrow keys, and stand in the address; a phone shows
   one. */
const work = document.querySelector(".work");
const LINES = { x: [15, 80, "%"], y: [20, 85, "%"], z: [0, 520, "px"] };
function place(lines) {
  for (const [name, value] of Object.entries(lines)) {
    const [least, most, unit] = LINES[name];
    if (!Number.isFinite(value)) continue;
    const kept = Math.round(10 * Math.min(most, Math.max(least, value))) / 10;
    work.style.setProperty("--" + name, kept + unit);
    work.querySelector(".split." + name)?.setAttribute("aria-valuenow", kept);
  }
}
const lineAt = (name) => parseFloat(getComputedStyle(work).getPropertyValue("--" + name));
function seePane(pane) {
  for (const each of work.querySelectorAll(".pane")) each.classList.toggle("shown", each === pane);
  for (const button of document.querySelectorAll(".phone button"))
    button.setAttribute("aria-pressed", String(button.value === pane.dataset.pane));
}
function moveLine(line, { clientX, clientY }) {
  const box = work.getBoundingClientRect();
  const [name] = line.classList[1];
  place({
    [name]: {
      x: (100 * (clientX - box.left)) / box.width,
      y: (100 * (clientY - box.top)) / box.height,
      z: box.right - clientX,
    }[name],
  });
}
function openWork() {
  const [x, y, z] = (shown.get("w") ?? "").split("~").map((part) => parseFloat(part));
  place({ x, y, z });
  const kept = () => keep({ w: ["x", "y", "z"].map(lineAt).join("~") });
  for (const line of work.querySelectorAll(".split")) {
    const name = line.classList[1];
    line.setAttribute("aria-valuenow", lineAt(name));
    line.addEventListener("pointerdown", (event) => {
      line.setPointerCapture(event.pointerId);
      line.classList.add("held");
    });
    line.addEventListener("pointermove", (event) => {
      if (line.classList.contains("held")) moveLine(line, event);
    });
    line.addEventListener("lostpointercapture", () => {
      line.classList.remove("held");
      kept();
    });
    line.addEventListener("keydown", ({ key }) => {
      const way = { ArrowLeft: -1, ArrowUp: -1, ArrowRight: 1, ArrowDown: 1 }[key];
      if (!way) return;
      place({ [name]: lineAt(name) + (name === "z" ? -20 : 2) * way });
      kept();
    });
  }
  const panes = [...work.querySelectorAll(".pane")];
  const phone = document.querySelector(".phone");
  phone.append(
    ...panes.map((pane) => {
      const { pane: value } = pane.dataset;
      const onclick = () => {
        if (work.hidden) location.hash = "";
        seePane(pane);
      };
      return made("button", { className: "tool", value, onclick }, value);
    }),
  );
  seePane(panes[0]);
  if (document.querySelector(`.bar [data-tab="${shown.get("t")}"]`)) seeInner(shown.get("t"));
}

/* A table that is sorted by its heads, filtered, copied, and of which rows are chosen where they
   have `aria-selected`: by click, with Ctrl one more, with Shift up to there, by arrow keys. */
class Sheet {
  constructor(table) {
    this.table = table;
    this.body = table.tBodies[0];
    table.sheet = this;
    [...table.tHead.rows[0].cells].forEach((head, column) => {
      if (!head.textContent.trim()) return;
      const onclick = () => this.sort(head, column);
      head.append(made("button", { className: "sort", onclick }, ...head.childNodes));
    });
    this.body.addEventListener("click", (event) => {
      const row = event.target.closest("tr[aria-selected]");
      if (row && !event.target.closest("a, button, input, select, summary, form"))
        this.pick(row, event);
    });
    this.body.addEventListener("keydown", (event) => this.key(event));
    this.reach();
  }
  get rows() {
    return [...this.body.rows];
  }
  get seen() {
    return this.rows.filter((row) => !row.hidden);
  }
  get chosen() {
    return this.rows.filter((row) => row.ariaSelected === "true");
  }
  /* One row is reached by the tab key, the others by arrows. */
  reach(row = this.chosen[0] ?? this.seen.find((each) => each.ariaSelected)) {
    for (const each of this.rows) if (each.ariaSelected) each.tabIndex = each === row ? 0 : -1;
  }
  choose(rows) {
    for (const row of this.rows)
      if (row.ariaSelected) row.ariaSelected = String(rows.includes(row));
    this.reach();
  }
  pick(row, { ctrlKey, metaKey, shiftKey } = {}) {
    const { seen, chosen } = this;
    let rows = [row];
    if (ctrlKey || metaKey)
      rows = chosen.includes(row) ? chosen.filter((each) => each !== row) : [...chosen, row];
    else if (shiftKey && this.last) {
      const ends = [seen.indexOf(this.last), seen.indexOf(row)].sort((a, b) => a - b);
      rows = seen.slice(ends[0], ends[1] + 1);
    }
    if (!shiftKey) this.last = row;
    this.choose("several" in this.table.dataset ? rows : [row]);
    this.table.dispatchEvent(new CustomEvent("picked", { detail: row, bubbles: true }));
  }
  key(event) {
    const row = event.target.closest("tr");
    if (event.target !== row) return;
    const way = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    const next = way && this.seen[this.seen.indexOf(row) + way];
    if (way) event.preventDefault();
    if (!next?.ariaSelected) return;
    next.focus();
    this.pick(next, event.shiftKey ? { shiftKey: true } : {});
  }
  sort(head, column) {
    const up = head.ariaSort !== "ascending";
    for (const other of head.parentElement.cells) other.removeAttribute("aria-sort");
    head.ariaSort = up ? "ascending" : "descending";
    const value = (row) => row.cells[column]?.textContent.trim() ?? "";
    const size = (text) => Number.parseFloat(text.replace("−", "-"));
    this.body.append(
      ...this.rows.sort((a, b) => {
        const [p, q] = [value(a), value(b)];
        const apart = size(p) - size(q) || p.localeCompare(q, undefined, { numeric: true });
        return up ? apart : -apart;
      }),
    );
  }
  filter(text) {
    const words = text.toLowerCase().split(/\s+/);
    for (const row of this.rows)
      row.hidden = !words.every((word) => row.textContent.toLowerCase().includes(word));
    this.reach();
  }
  /* What is seen as text, of several chosen rows those. */
  text(parted) {
    const { chosen, seen, table } = this;
    const safe = (cell) => {
      const said = cell.innerText.replace(/\s+/g, " ").replace(/−(?=\d)/g, "-").trim();
      return parted === "," && /[",]/.test(said) ? `"${said.replaceAll('"', '""')}"` : said;
    };
    const rows = [table.tHead.rows[0], ...(chosen.length > 1 ? chosen : seen)];
    return rows.map((row) => [...row.cells].map(safe).join(parted)).join("\n") + "\n";
  }
}
for (const table of document.querySelectorAll(".sheet")) new Sheet(table);
const sheetOf = (element, name) => element.closest(".pane, section").querySelector(name).sheet;
document.addEventListener("input", ({ target }) => {
  if (target.dataset?.filterRows) sheetOf(target, target.dataset.filterRows).filter(target.value);
});
document.addEventListener("click", async ({ target }) => {
  const button = target.closest?.("[data-copy]");
  if (!button) return;
  const sheets = button.closest(".pane, section").querySelectorAll(".sheet");
  const { sheet } = [...sheets].find((table) => table.offsetParent);
  const csv = button.dataset.copy === "csv";
  const text = sheet.text(csv ? "," : "\t");
  if (csv) save(new Blob([text], { type: "text/csv" }), `${sheet.table.ariaLabel}.csv`);
  else
    await navigator.clipboard.writeText(text).then(
      () => say("Copied: paste it into a spreadsheet."),
      () => save(new Blob([text]), `${sheet.table.ariaLabel}.txt`),
    );
});
function save(blob, download) {
  const link = made("a", { href: URL.createObjectURL(blob), download });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

if (work) openWork();
seePart();
addEventListener("hashchange", seePart);
