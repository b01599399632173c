/* A mesh as triangles, wires, outlines and junctions; and a still picture of it, for a browser
   without WebGL. */

/* Corners in order, then the middles of their sides: the ring around an element is corner, middle,
   corner, middle. */
const SHARP = Math.cos((20 * Math.PI) / 180); // walls that meet at a larger angle make a junction

function ringOf(corners, nodes) {
  if (corners === 2) return nodes.length === 3 ? [nodes[0], nodes[2], nodes[1]] : nodes;
  if (nodes.length === corners) return nodes;
  return nodes.slice(0, corners).flatMap((node, i) => [node, nodes[corners + i]]);
}
/* Triangles of a ring: of one with middles its corners are cut off first. */
function trianglesOf(ring, corners) {
  if (ring.length === corners)
    return corners === 3
      ? [ring]
      : [
          [ring[0], ring[1], ring[2]],
          [ring[0], ring[2], ring[3]],
        ];
  const at = (i) => ring[(i + ring.length) % ring.length];
  const cut = Array.from({ length: corners }, (_, i) => [at(2 * i - 1), at(2 * i), at(2 * i + 1)]);
  const middles = ring.filter((_, i) => i % 2);
  return [...cut, ...trianglesOf(middles, corners)];
}
function normalOf(positions, [a, b, c]) {
  const side = (p, q) => [0, 1, 2].map((k) => positions[3 * q + k] - positions[3 * p + k]);
  const [u, v] = [side(a, b), side(a, c)];
  const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
  const length = Math.hypot(...n) || 1;
  return n.map((value) => value / length);
}
/* Sides of elements by their ends: a side of one element is an outline, one of more, or at an
   angle, a junction. Arrays of numbers and no object a side: what a mesh leaves to be collected
   would stop the picture. */
class Sides {
  constructor(most, nodes) {
    this.count = nodes;
    this.at = new Map();
    this.nodes = new Int32Array(3 * most); // ends, and the middle, or again the second end
    this.normals = new Float32Array(3 * most);
    this.sets = new Int32Array(most);
    this.elements = new Uint8ClampedArray(most);
    this.askew = new Uint8Array(most);
    this.between = new Uint8Array(most); // sets
  }
  /* Of one more element; its lines where it is a new side. */
  add(a, b, middle, normal, set) {
    const key = Math.min(a, b) * this.count + Math.max(a, b);
    let i = this.at.get(key);
    const isNew = i === undefined;
    if (isNew) {
      i = this.at.size;
      this.at.set(key, i);
      this.nodes.set([a, b, middle], 3 * i);
      this.normals.set(normal, 3 * i);
      this.sets[i] = set;
    }
    const along = normal.reduce((sum, value, k) => sum + value * this.normals[3 * i + k], 0);
    if (Math.abs(along) < SHARP) this.askew[i] = 1;
    if (this.sets[i] !== set) this.between[i] = 1;
    this.elements[i] += 1;
    return isNew ? this.lines(i) : [];
  }
  lines(i) {
    const [a, b, middle] = this.nodes.subarray(3 * i, 3 * i + 3);
    return middle === b ? [a, b] : [a, middle, middle, b];
  }
  sorted() {
    const outline = [],
      junctions = [];
    for (let i = 0; i < this.at.size; i += 1) {
      const isJunction = this.elements[i] > 2 || this.askew[i];
      if (isJunction) junctions.push(...this.lines(i));
      if (isJunction || this.elements[i] === 1 || this.between[i]) outline.push(...this.lines(i));
    }
    return { outline: Uint32Array.from(outline), junctions: Uint32Array.from(junctions) };
  }
}
/* Typed arrays of what a service's mesh says. */
export function meshOf(said) {
  const count = said.nodes.x_m.length;
  const positions = new Float32Array(3 * count);
  ["x_m", "y_m", "z_m"].forEach((axis, k) =>
    said.nodes[axis].forEach((value, i) => {
      positions[3 * i + k] = value;
    }),
  );
  const names = [...new Set(said.blocks.map(({ set }) => set))];
  const sets = names.map((name) => ({ name, elements: 0, triangles: [], wires: [] }));
  const most = said.blocks.reduce((sum, { corners, nodes }) => sum + corners * nodes.length, 0);
  const sides = new Sides(most, count);
  for (const { set: name, corners, nodes: elements } of said.blocks) {
    const which = names.indexOf(name),
      set = sets[which];
    set.elements += elements.length;
    if (corners === 1) continue; // nodes alone
    for (const nodes of elements) {
      const ring = ringOf(corners, nodes);
      if (corners === 2) {
        for (let i = 1; i < ring.length; i += 1) set.wires.push(ring[i - 1], ring[i]);
        continue;
      }
      for (const triangle of trianglesOf(ring, corners)) set.triangles.push(...triangle);
      const normal = normalOf(positions, nodes);
      const step = ring.length / corners;
      for (let i = 0; i < ring.length; i += step) {
        const end = ring[(i + step) % ring.length];
        set.wires.push(...sides.add(ring[i], end, step === 2 ? ring[i + 1] : end, normal, which));
      }
    }
  }
  for (const set of sets)
    for (const part of ["triangles", "wires"]) set[part] = Uint32Array.from(set[part]);
  return {
    positions,
    sets,
    ...sides.sorted(),
    held: [...new Set((said.supports ?? []).flatMap((s) => s.nodes))],
    masses: said.masses ?? [],
  };
}
export const noMesh = () => ({
  positions: new Float32Array(0),
  sets: [],
  outline: [],
  junctions: [],
  held: [],
  masses: [],
});

/* Seen from the front, the right and above, as the picture in space is at first. */
const VIEW = [
  [0.88, 0.47, 0],
  [-0.2, 0.38, 0.9],
];
const flat = (x, y, z) => [
  VIEW[0][0] * x + VIEW[0][1] * y + VIEW[0][2] * z,
  -(VIEW[1][0] * x + VIEW[1][1] * y + VIEW[1][2] * z),
];

/* An SVG of what is to be seen, moved by `reach` m where it has a shape. */
export function still(scene, shape, reach, colors) {
  const svg = drawn(document.createDocumentFragment(), "svg", {});
  const places = (rest, motion) =>
    Array.from({ length: rest.length / 3 }, (_, i) =>
      flat(...[0, 1, 2].map((k) => rest[3 * i + k] + (motion ? reach * motion[3 * i + k] : 0))),
    );
  const nodes = places(scene.mesh.positions),
    points = places(scene.positions);
  const all = [...nodes, ...points];
  if (!all.length) return svg;
  const [xs, ys] = [0, 1].map((k) => all.map((p) => p[k]));
  const [left, top] = [Math.min(...xs), Math.min(...ys)];
  const size = Math.max(Math.max(...xs) - left, Math.max(...ys) - top) || 1;
  const put = (p) => p.map((value, k) => ((value - [left, top][k]) / size) * 700 + 50);
  const lines = (pairs, at, stroke, dash = "") => {
    if (pairs.length)
      drawn(svg, "path", {
        d: Array.from(
          { length: pairs.length / 2 },
          (_, i) =>
            "M" +
            put(at[pairs[2 * i]]).map((v) => v.toFixed(1)) +
            "L" +
            put(at[pairs[2 * i + 1]]).map((v) => v.toFixed(1)),
        ).join(""),
        stroke,
        fill: "none",
        "stroke-dasharray": dash,
      });
  };
  scene.mesh.sets.forEach((set, i) => lines(set.wires, nodes, colors.sets[i % colors.sets.length]));
  if (shape?.nodes)
    lines(scene.mesh.outline, places(scene.mesh.positions, shape.nodes.real), colors.updated);
  const moved = shape?.points ? places(scene.positions, shape.points.real) : points;
  lines(scene.joined, moved, colors.measured);
  for (const p of moved.filter((_, i) => !scene.points[i].bare)) {
    const [cx, cy] = put(p);
    drawn(svg, "circle", { cx: cx.toFixed(1), cy: cy.toFixed(1), r: 5, fill: colors.measured });
  }
  svg.setAttribute(
    "viewBox",
    `0 0 800 ${(((Math.max(...ys) - top) / size) * 700 + 100).toFixed(0)}`,
  );
  return svg;
}
