/* A matrix of a figure as bars in space: one for each pair, as high as its value and in the colour
   of its tenth. */

const CIVIDIS = [
  "#00224e",
  "#123570",
  "#3b496c",
  "#575d6d",
  "#707173",
  "#8a8678",
  "#a59c74",
  "#c3b369",
  "#e1cc55",
  "#fee838",
];
const WIDE = 0.36; // half of a bar, of the distance of two
const FACES = [
  [4, 5, 7, 6],
  [0, 1, 5, 4],
  [2, 3, 7, 6],
  [0, 2, 6, 4],
  [1, 3, 7, 5],
].flatMap(([a, b, c, d]) => [a, b, c, a, c, d]);
const EDGES = [0, 1, 1, 3, 3, 2, 2, 0, 4, 5, 5, 7, 7, 6, 6, 4, 0, 4, 1, 5, 2, 6, 3, 7];
const CORNERS = [0, 1, 2, 3, 4, 5, 6, 7];

/* The rows run away from the front, the columns to the right. */
export function barsOf({ data: [matrix], layout }) {
  const values = matrix.z,
    [rows, columns] = [
      namesOf(layout.yaxis, values.length),
      namesOf(layout.xaxis, values[0].length),
    ];
  const high = 0.5 * Math.max(rows.length, columns.length);
  const sets = CIVIDIS.map((color, k) => ({
    name: `${k / 10} to ${(k + 1) / 10}`,
    elements: 0,
    triangles: [],
    wires: [],
  }));
  const positions = [],
    points = [];
  values.forEach((row, i) =>
    row.forEach((value, j) => {
      if (value === null) return;
      const set = sets[Math.min(9, Math.floor(10 * value))],
        first = positions.length / 3;
      for (const k of CORNERS)
        positions.push(
          j + (k & 1 ? WIDE : -WIDE),
          -i + (k & 2 ? WIDE : -WIDE),
          k & 4 ? high * value : 0,
        );
      set.elements += 1;
      set.triangles.push(...FACES.map((k) => first + k));
      set.wires.push(...EDGES.map((k) => first + k));
      points.push({
        label: "",
        bare: true,
        words: `${rows[i]} and ${columns[j]}: ${matrix.colorbar.title.text} ${value.toFixed(3)}`,
        x_m: j,
        y_m: -i,
        z_m: high * value,
      });
    }),
  );
  const named = [
    ...rows.map((label, i) => ({ label, x_m: columns.length - 0.5, y_m: -i })),
    ...columns.map((label, j) => ({ label, x_m: j, y_m: -rows.length })),
  ];
  points.push(...named.map((point) => ({ ...point, z_m: 0, bare: true, words: point.label })));
  return {
    mesh: {
      positions: Float32Array.from(positions),
      sets,
      outline: [],
      junctions: [],
      held: [],
      masses: [],
    },
    said: { points },
    colors: CIVIDIS,
  };
}
const namesOf = (axis, count) =>
  Array.from({ length: count }, (_, k) => axis.ticktext[axis.tickvals.indexOf(k)] ?? String(k + 1));
