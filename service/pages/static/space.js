/* The structure in space: what is asked for, the controls around the picture, and what is chosen
   there. Loaded by a page that has a place for it; the drawing itself is fetched when that place
   comes into sight. */
const AXES = ["x", "y", "z"];
const COLORS = ["text", "hint", "measured", "initial", "updated", "care", "bad", "good"];
/* Of sets: they differ in lightness too (Okabe and Ito). */
const SETS = [
  "#0072b2",
  "#e69f00",
  "#009e73",
  "#cc79a7",
  "#56b4e9",
  "#d55e00",
  "#f0e442",
  "#8a8f96",
];

const counted = (count, one, many = one + "s") => `${count} ${count === 1 ? one : many}`;

/* Points and mesh as the drawing takes them. */
function sceneOf(mesh, said) {
  const points = said?.points ?? [];
  return {
    mesh,
    points,
    joined: (said?.joined ?? []).flat(),
    positions: Float32Array.from(points.flatMap((p) => [p.x_m, p.y_m, p.z_m])),
    arrows: points.flatMap((p, point) =>
      ["response", "reference"].flatMap((role) =>
        (p[role] ?? []).map((along) => ({ point, along, role })),
      ),
    ),
  };
}
/* A motion as arrays that leave nothing to be collected. */
const floats = (motion) =>
  motion && { real: Float32Array.from(motion.real), imag: Float32Array.from(motion.imag) };
/* A measured shape of a mode set at the points: its largest value real and 1. */
function shapeOf(values, said) {
  const row = new Map(said.points.map((p, i) => [p.label, i]));
  const motion = {
    real: new Float32Array(3 * said.points.length),
    imag: new Float32Array(3 * said.points.length),
  };
  const seen = values.filter((v) => row.has(v.point) && Math.abs(v.direction) <= 3);
  if (!seen.length) return null;
  const main = seen.reduce((best, v) =>
    Math.hypot(v.real, v.imag) > Math.hypot(best.real, best.imag) ? v : best,
  );
  const size = main.real ** 2 + main.imag ** 2;
  for (const v of seen) {
    const sign = Math.sign(v.direction);
    const [re, im] = [
      (v.real * main.real + v.imag * main.imag) / size,
      (v.imag * main.real - v.real * main.imag) / size,
    ];
    said.axes[Math.abs(v.direction) - 1].forEach((along, k) => {
      motion.real[3 * row.get(v.point) + k] += sign * re * along;
      motion.imag[3 * row.get(v.point) + k] += sign * im * along;
    });
  }
  return { nodes: null, points: motion, measured: true };
}

class Viewer {
  constructor(place) {
    this.place = place;
    this.part = (name) => place.querySelector(`[data-space-${name}]`);
    this.quiet = matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.colors = { ...Object.fromEntries(COLORS.map((name) => [name, css("--" + name)])), sets: SETS };
    this.state = { amplitude: 0.5, phase: 0, speed: 1, running: false };
    this.shapes = [];
    this.asked = new URLSearchParams(location.search);
  }
  say(text) {
    this.part("said").textContent = text;
  }
  async open() {
    const { dataset } = this.place;
    try {
      const [three, geometry, drawing, frame, bars] = await Promise.all(
        dataset.modules.trim().split(/\s+/).map((path) => import(at(path))),
      );
      this.geometry = geometry;
      this.scene = bars ? await this.bars(bars) : await this.structure();
      if (made("canvas").getContext("webgl2"))
        this.draw(three, drawing, new frame.Frame(this.part("labels"), !bars));
      else this.flat();
    } catch (error) {
      this.say(error.message);
      this.part("picture").querySelector(".wait")?.remove();
      this.place.dataset.ready = "nothing";
      return;
    }
    this.legend();
    this.listen();
    await this.first();
    this.place.dataset.ready = this.space ? "webgl" : "still";
  }
  async bars(geometry) {
    const { mesh, said, colors } = geometry.barsOf(await get(this.place.dataset.bars));
    this.colors.sets = colors;
    return sceneOf(mesh, said);
  }
  /* A result or a solved model has its own mesh and points; a test has points, and its structure may
     have a mesh. */
  async structure() {
    const { result, mesh, points } = this.place.dataset;
    this.said = result
      ? await get(`${result}/mesh`)
      : points
        ? JSON.parse(document.getElementById(points).textContent)
        : null;
    let found = result ? this.said : null;
    try {
      if (mesh) found = await get(mesh);
    } catch (error) {
      if (!this.said?.points.length) throw error;
    }
    const drawn = found ? this.geometry.meshOf(found) : this.geometry.noMesh();
    if (found) found.nodes = found.blocks = null; // which are large, and are in the arrays now
    return sceneOf(drawn, this.said);
  }
  draw(three, drawing, frame) {
    const canvas = this.part("canvas");
    canvas.hidden = false;
    this.part("picture").hidden = true;
    this.space = new drawing.Space(three, canvas, this.scene, this.colors, {
      frame,
      chosen: (i) => this.choose(i),
      moved: () => this.run(!this.state.running),
    });
    canvas.addEventListener("webglcontextlost", () => {
      this.space = null;
      canvas.hidden = this.part("labels").hidden = true;
      this.flat();
    });
    this.part("home").hidden = this.part("keys").hidden = false;
  }
  flat() {
    const { geometry, scene, shapes, colors } = this;
    const reach =
      0.2 *
      Math.max(
        ...[0, 1, 2].map((k) => {
          const all = [...scene.positions, ...scene.mesh.positions].filter((_, i) => i % 3 === k);
          return Math.max(...all) - Math.min(...all);
        }),
      );
    const picture = this.part("picture");
    const nodes = shapes.find((shape) => shape.nodes)?.nodes,
      points = shapes.find((shape) => shape.measured)?.points;
    picture.replaceChildren(geometry.still(scene, { nodes, points }, 0.5 * reach, colors));
    picture.hidden = false;
  }
  legend() {
    const { scene, colors } = this;
    const { bars, result } = this.place.dataset;
    const listed = result
      ? [
          ...(this.said.measured.length ? [[colors.hint, "measured, expanded over the mesh"]] : []),
          [colors.updated, "the model"],
        ]
      : scene.mesh.sets.flatMap((set, i) =>
          set.elements
            ? [
                [
                  colors.sets[i % colors.sets.length],
                  `${set.name}, ${counted(set.elements, bars ? "pair" : "element")}`,
                ],
              ]
            : [],
        );
    const of = (count, color, words) => {
      if (count) listed.push([color, words]);
    };
    of(scene.mesh.held.length, colors.care, `held: ${counted(scene.mesh.held.length, "node")}`);
    of(scene.mesh.junctions.length, colors.initial, "junctions of walls");
    of(scene.mesh.masses.length, colors.good, counted(scene.mesh.masses.length, "mass", "masses"));
    const measured = scene.points.filter((point) => !point.bare).length;
    of(measured, colors.measured, counted(measured, "measured point"));
    of(
      scene.arrows.some((a) => a.role === "response"),
      colors.measured,
      "→ measured directions",
    );
    of(
      scene.arrows.some((a) => a.role === "reference"),
      colors.initial,
      "→ directions of references, such as hits",
    );
    of(
      scene.points.some((p) => p.off),
      colors.bad,
      "points off the structure",
    );
    this.part("legend").replaceChildren(
      ...listed.map(([color, words]) => {
        const swatch = made("i");
        swatch.style.background = color;
        return made("li", {}, swatch, words);
      }),
    );
  }
  listen() {
    const on = (name, type, does) =>
      this.part(name)?.addEventListener(type, (event) => does(event.target));
    on("home", "click", () => this.space.home());
    on("run", "click", () => this.run(!this.state.running));
    for (const name of ["amplitude", "speed", "phase"])
      on(name, "input", (input) =>
        this.set({ [name]: Number(input.value) * (name === "phase" ? Math.PI / 180 : 1) }),
      );
    on("point", "change", (list) => this.choose(Number(list.value)));
    on("distances", "click", (button) => this.distances(button));
    for (const name of ["measured", "model", "layout"])
      on(name, "change", (list) => {
        keep({ ["space-" + name]: list.value || null });
        const pair = ["measured", "model"].map((side) => this.part(side).value);
        if (name === "layout") this.show(this.shapes, this.part("said").textContent);
        else if (work?.contains(this.place)) tell("mode-chosen", { pair });
        else this.compare();
      });
    if (this.place.dataset.result && work?.contains(this.place))
      hear("mode-chosen", ({ pair }) => this.choosePair(pair));
    hear("chosen", ([row, ...more]) => {
      const at = this.scene.points.findIndex((p) => p.label === row?.points[0]);
      if (at >= 0 && !more.length) this.mark(at, false);
    });
    hear("shape-chosen", (which) => this.said && this.setOf(which));
    const list = this.part("point");
    if (list)
      list.append(
        ...this.scene.points.map(
          (p, i) =>
            new Option(
              p.words ??
                `${p.label}: ${AXES.map((axis) => short(1e3 * p[axis + "_m"], 4)).join(", ")} mm`,
              i,
            ),
        ),
      );
    list?.closest("label").toggleAttribute("hidden", !this.scene.points.length);
  }
  /* What the address names, or the first mode of a result. */
  async first() {
    if (this.place.dataset.result) {
      const fill = (name, modes, words) => {
        const list = this.part(name);
        list.append(...modes.map((m) => new Option(words(m), m.number)));
        list.value = this.asked.get("space-" + name) ?? String(modes[0]?.number ?? "");
      };
      fill("measured", this.said.measured, (m) => `${m.number}: ${short(m.frequency_hz, 5)} Hz`);
      fill(
        "model",
        this.said.model,
        (m) => `${m.number}: ${short(m.frequency_hz, 5)} Hz, ${m.kind}`,
      );
      const pair = this.said.measured.find((m) => String(m.number) === this.part("measured").value);
      if (!this.asked.has("space-model") && pair) this.part("model").value = pair.model ?? "";
      this.part("measured").hidden = this.part("layout").parentElement.hidden =
        !this.said.measured.length;
      this.part("layout").value =
        this.asked.get("space-layout") ??
        (matchMedia("(max-width: 640px)").matches ? "over" : "beside");
      await this.compare();
    }
    if (this.place.dataset.campaign && this.asked.has("mode") && chosenShape)
      await this.setOf(chosenShape);
    const at = this.scene.points.findIndex((p) => String(p.label) === this.asked.get("point"));
    if (at >= 0) this.mark(at);
  }
  /* Shapes that are asked for, and words of them: those of the last wish are shown, in whatever
     order the answers come. */
  async latest(wish) {
    this.wish = wish;
    try {
      const found = await wish;
      if (this.wish === wish) this.show(...found);
    } catch (error) {
      if (this.wish === wish) this.say(error.message);
    }
  }
  choosePair(pair) {
    ["measured", "model"].forEach((side, k) => {
      if (pair[k] !== undefined) this.part(side).value = pair[k];
    });
    return this.compare();
  }
  /* The shapes of a result that its lists name. */
  compare() {
    return this.latest(this.pair());
  }
  async pair() {
    const wanted = ["measured", "model"]
      .map((side) => [side, this.part(side).value])
      .filter(([, value]) => value);
    const found = await Promise.all(
      wanted.map(([side, value]) =>
        get(`${this.place.dataset.result}/mesh/shapes?${side}=${value}`),
      ),
    );
    const words = found
      .map((shape, i) =>
        wanted[i][0] === "measured"
          ? `Measured mode ${wanted[i][1]}, ${shape.words}`
          : `model mode ${wanted[i][1]}`,
      )
      .join("; ");
    const shapes = found.map(({ nodes, points }, i) => ({
      nodes: floats(nodes),
      points: floats(points),
      measured: wanted[i][0] === "measured",
    }));
    return [shapes, words];
  }
  /* A measured mode of a test's mode sets. */
  async setOf({ set: id, number: which }) {
    await this.latest(
      get(`mode-sets/${id}`).then((set) => {
        const mode = set.modes.find((m) => m.number === which);
        const shape = shapeOf(mode.shape, this.said);
        const words = `${set.name}, mode ${mode.number}: ${short(mode.frequency_hz, 5)} Hz`;
        return [
          shape ? [shape] : [],
          shape ? words : words + ": none of its points is on the grid",
        ];
      }),
    );
  }
  show(shapes, words) {
    this.shapes = shapes;
    this.part("motion").hidden = !shapes.length;
    this.part("run").hidden = !this.space || !shapes.length;
    if (this.space) this.space.show(shapes, this.part("layout")?.value === "beside");
    else this.flat();
    this.say(words);
    this.run(shapes.length > 0 && !this.quiet);
  }
  set(changes) {
    Object.assign(this.state, changes);
    this.space?.set(changes);
  }
  run(on) {
    const button = this.part("run");
    button.textContent = on ? "Stop" : "Move";
    button.setAttribute("aria-pressed", String(on));
    if (!on && this.space) {
      this.state.phase = this.space.state.phase;
      this.part("phase").value = Math.round((this.state.phase * 180) / Math.PI);
    }
    this.set({ running: on && Boolean(this.space) });
  }
  /* A point that was clicked or listed: marked here, and said to whoever shows its FRFs. */
  choose(i) {
    const point = this.scene.points[i];
    if (!point) return;
    this.mark(i);
    if (point.words) return;
    keep({ point: point.label });
    tell("point-chosen", { point: point.label });
  }
  mark(i, said = true) {
    const point = this.scene.points[i];
    this.space?.select(i);
    this.part("point").value = i;
    if (!said) return;
    if (point.words) return this.say(point.words);
    const place = AXES.map((axis) => `${axis} ${short(1e3 * point[axis + "_m"], 4)}`).join(", ");
    this.say(
      `Point ${point.label}: ${place} mm` +
        ("frfs" in point ? `; ${counted(point.frfs, "FRF")}` : "") +
        ("distance_m" in point ? `; ${short(1e3 * point.distance_m, 3)} mm from the structure` : ""),
    );
  }
  async distances(button) {
    button.disabled = true;
    try {
      const found = await get(`campaigns/${this.place.dataset.campaign}/alignment`);
      const of = new Map(found.items.map((item) => [item.label, item]));
      for (const point of this.scene.points) {
        const item = of.get(point.label);
        if (item) Object.assign(point, { distance_m: item.distance_m, off: item.off });
      }
      this.show(
        this.shapes,
        `The points lie ${short(1e3 * found.rms_m, 3)} mm (rms) from the structure` +
          (found.off.length
            ? `; ${counted(found.off.length, "point")} further than an update takes: ${found.off.slice(0, 10).join(", ")}`
            : "."),
      );
      this.legend();
    } catch (error) {
      this.say(error.message);
      button.disabled = false;
    }
  }
}
for (const place of document.querySelectorAll("[data-space]")) {
  const sight = new IntersectionObserver(
    (entries) => {
      if (entries.some((e) => e.isIntersecting)) {
        sight.disconnect();
        new Viewer(place).open();
      }
    },
    { rootMargin: "300px" },
  );
  sight.observe(place);
}
