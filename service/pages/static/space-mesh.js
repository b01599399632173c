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
   angle, a junction. */
function sorted(sides) {
  const outline = [],
    junctions = [],
    borders = [];
  for (const { pairs, normals, sets } of sides.values()) {
    const [first, ...others] = normals;
    const askew = others.some(
      (n) => Math.abs(n[0] * first[0] + n[1] * first[1] + n[2] * first[2]) < SHARP,
    );
    if (normals.length > 2 || askew) junctions.push(...pairs);
    else if (normals.length === 1) outline.push(...pairs);
    else if (new Set(sets).size > 1) borders.push(...pairs);
  }
  return { outline: [...outline, ...borders, ...junctions], junctions };
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
  const sets = new Map();
  const sides = new Map();
  for (const block of said.blocks) {
    if (!sets.has(block.set))
      sets.set(block.set, { name: block.set, elements: 0, triangles: [], wires: [] });
    const set = sets.get(block.set);
    const corners = block.corners;
    for (const nodes of block.nodes) {
      const ring = ringOf(corners, nodes);
      set.elements += 1;
      if (corners === 1) continue; // a node alone
      if (corners === 2) {
        for (let i = 1; i < ring.length; i += 1) set.wires.push(ring[i - 1], ring[i]);
        continue;
      }
      const triangles = trianglesOf(ring, corners);
      set.triangles.push(...triangles.flat());
      const normal = normalOf(positions, nodes);
      const step = ring.length / corners;
      for (let i = 0; i < corners; i += 1) {
        const along = Array.from(
          { length: step + 1 },
          (_, k) => ring[(i * step + k) % ring.length],
        );
        const pairs = along.slice(1).flatMap((node, k) => [along[k], node]);
        const [a, b] = [along[0], along.at(-1)];
        const key = Math.min(a, b) * count + Math.max(a, b);
        if (!sides.has(key)) {
          sides.set(key, { pairs, normals: [], sets: [] });
          set.wires.push(...pairs);
        }
        sides.get(key).normals.push(normal);
        sides.get(key).sets.push(block.set);
      }
    }
  }
  return {
    positions,
    sets: [...sets.values()],
    ...sorted(sides),
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
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
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
  const drawn = (name, said) => {
    const part = document.createElementNS(svg.namespaceURI, name);
    Object.entries(said).forEach(([key, value]) => part.setAttribute(key, value));
    svg.append(part);
  };
  const lines = (pairs, at, stroke, dash = "") => {
    if (pairs.length)
      drawn("path", {
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
    drawn("circle", { cx: cx.toFixed(1), cy: cy.toFixed(1), r: 5, fill: colors.measured });
  }
  svg.setAttribute(
    "viewBox",
    `0 0 800 ${(((Math.max(...ys) - top) / size) * 700 + 100).toFixed(0)}`,
  );
  return svg;
}
