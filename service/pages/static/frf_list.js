"use strict";
/* Which FRFs a viewer has, which of them are chosen, and their values, read as they are asked for.
 */
const SIGNED = (direction) =>
  (direction > 0 ? "+" : "−") + ["", "x", "y", "z", "rx", "ry", "rz"][Math.abs(direction)];
const PALETTE = [
  "#0072b2",
  "#d55e00",
  "#009e73",
  "#cc79a7",
  "#e69f00",
  "#56b4e9",
  "#8a6d3b",
  "#7a5fb5",
];
const MOST_OFFERED = 300; // response points in the list that chooses all FRFs of one
const AT_ONCE = 6; // requests that a browser sends one host at a time

class FrfList {
  /* `view` is the viewer: its source, its parts, and what it does when the choice has changed. */
  constructor(view) {
    this.view = view;
    this.rows = [];
    this.loaded = new Map();
    this.asked = 0;
    this.shown = null;
  }

  /* Names are those of places, so that an address says the same after another import. */
  add(campaign, first = false) {
    const several = this.view.source.campaigns.length > 1;
    for (const frf of campaign.frfs) this.append(this.rowOf(campaign, frf, first, several));
    this.view.part("frfs").sheet.reach(this.rows[0]?.line);
    const all = (key, prefix, word) =>
      [...new Set(this.rows.map((row) => row[key]))]
        .slice(0, MOST_OFFERED)
        .map((name) => new Option(`all of ${word} ${name}`, prefix + name));
    this.view
      .part("all")
      .replaceChildren(
        new Option("choose …", ""),
        new Option("all", "*"),
        ...all("reference", "", "reference"),
        ...all("response", "r", "response"),
      );
  }
  append(row) {
    this.rows.push(row);
    this.body.append(row.line);
  }
  get body() {
    return this.view.part("frfs").tBodies[0];
  }
  rowOf(campaign, [id, response, rd, reference, fd, quantity, label, averages], first, several) {
    const dof = `${response}${SIGNED(rd)}/${reference}${SIGNED(fd)}`;
    const base = `${campaign.id.slice(-6)}~${response}.${rd}~${reference}.${fd}`;
    const same = this.rows.filter((row) => row.base === base).length;
    const key = (first ? base.slice(7) : base) + (same ? `~${same + 1}` : "");
    return {
      id,
      base,
      key,
      campaign,
      quantity,
      averages,
      points: [response, reference],
      dofs: [response, rd, reference],
      response: `${response}${SIGNED(rd)}`,
      reference: `${reference}${SIGNED(fd)}`,
      name: (several ? `${campaign.name}: ` : "") + dof,
      line: tableLine([dof, quantity, averages ?? "–", label || "–", campaign.name]),
    };
  }
  async addCampaign(id) {
    const { source } = this.view;
    if (source.campaigns.some((c) => c.id === id)) return;
    const found = { id, name: (await get(`campaigns/${id}`)).name, frfs: [] };
    for (let cursor = null, more = true; more; more = cursor !== null) {
      const page = await get(
        `campaigns/${id}/frfs?limit=1000${cursor ? `&cursor=${encodeURIComponent(cursor)}` : ""}`,
      );
      found.frfs.push(
        ...page.items.map((f) => [
          f.id,
          f.response_point,
          f.response_direction,
          f.reference_point,
          f.reference_direction,
          f.quantity,
          f.label,
          f.averages,
        ]),
      );
      cursor = page.next_cursor;
    }
    source.campaigns.push(found);
    this.add(found);
    [...this.view.part("other").options].find((o) => o.value === id)?.remove();
  }

  chosen() {
    return this.rows.filter(isChosen);
  }
  choose(test) {
    this.view.part("frfs").sheet.choose(this.rows.filter(test).map((row) => row.line));
    this.view.part("all").value = "";
    this.load();
  }
  /* A point that was chosen elsewhere: its next FRF, or with `more` one more of them. */
  choosePoint(point, more) {
    const mine = this.rows.filter((row) => row.points.includes(point));
    if (!mine.length) return;
    const next = (mine.findIndex(isChosen) + 1) % mine.length;
    this.choose((row) => (more && isChosen(row)) || row === mine[next]);
  }

  /* What was chosen in the meantime wins; `shown` ends once the last choice is drawn. */
  load() {
    return (this.shown = this.showChosen(++this.asked));
  }
  async showChosen(mine) {
    const rows = this.chosen();
    this.view.remember();
    const wanted = rows.flatMap((row, i) => this.curvesOf(row, i, rows.length));
    this.view.say(wanted.length > 20 ? `Reading ${wanted.length} FRFs …` : "");
    const { found, faults } = await this.read(wanted, () => mine === this.asked);
    if (mine !== this.asked) return this.shown;
    const place = (curve) => wanted.findIndex((w) => w.path === curve.path);
    return this.view.show(
      found.sort((a, b) => place(a) - place(b)),
      faults,
      rows,
    );
  }
  /* Measured, and where a model is laid over them what it predicts: the initial one beside a single
     FRF alone. */
  curvesOf(row, i, count) {
    const color = count === 1 ? css("--measured") : PALETTE[i % PALETTE.length];
    const own = [
      {
        row,
        name: row.name,
        path: `frfs/${row.id}/data?format=npz`,
        color,
        width: count > 8 ? 1 : 1.6,
      },
    ];
    const job = this.view.part("model").value;
    if (!job || row.campaign !== this.view.source.campaigns[0]) return own;
    const [point, direction, reference] = row.dofs;
    const models = [
      ["initial", [2, 3], "--initial"],
      ["updated", [7, 4], "--updated"],
    ].slice(count > 1 ? 1 : 0);
    return [
      ...own,
      ...models.map(([model, dash, alone]) => ({
        row,
        model,
        name: `${row.name}, ${model}`,
        color: count === 1 ? css(alone) : color,
        width: 1.6,
        dash,
        path: `update-jobs/${job}/frfs/data?format=npz&model=${model}&point=${point}&direction=${direction}&reference=${reference}`,
      })),
    ];
  }
  async read(wanted, current) {
    const queue = [...wanted],
      found = [],
      faults = [];
    await Promise.all(
      Array.from({ length: AT_ONCE }, async () => {
        for (let next = queue.shift(); next && current(); next = queue.shift()) {
          try {
            found.push({ ...next, ...(await this.at(next.path)), quantity: next.row.quantity });
          } catch (error) {
            faults.push(error.message);
          }
        }
      }),
    );
    return { found, faults };
  }
  /* An FRF by its address, read once; what failed is asked for again. */
  at(path) {
    if (!this.loaded.has(path))
      this.loaded.set(
        path,
        fetched(path).catch((error) => {
          this.loaded.delete(path);
          throw error;
        }),
      );
    return this.loaded.get(path);
  }
}
const isChosen = ({ line }) => line.ariaSelected === "true";
const tableLine = (texts) =>
  made("tr", { ariaSelected: "false" }, ...texts.map((text) => made("td", {}, text)));
async function fetched(path) {
  const answer = await fetch(rest(path), { headers: { Accept: "application/x-npz" } });
  if (!answer.ok) throw new Error((await answer.json()).detail);
  return FrfData.curveOf(await answer.arrayBuffer());
}
