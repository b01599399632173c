/* What stands around a picture in space: the axes, a length, the scale of amplitudes, and names of
   points that do not cover one another. */
const STOPS = ["#00224e", "#434e6c", "#7d7c78", "#bcaf6f", "#fee838"]; // Cividis
const ARM = 26; // pixels of an axis that is seen from the side
const WIDEST = 110; // pixels of the length

export class Frame {
  /* `labels` is the layer over the canvas; `metric`: whether the picture has a length. */
  constructor(labels, metric) {
    this.labels = labels;
    this.svg = drawn(labels, "svg", { class: "space-frame" });
    if (!metric) return;
    this.axes = ["x", "y", "z"].map((name) => ({
      line: drawn(this.svg, "line", {}),
      text: drawn(this.svg, "text", { "text-anchor": "middle" }, name),
    }));
    this.length = drawn(this.svg, "path", {});
    this.words = drawn(this.svg, "text", { "text-anchor": "middle" });
    this.scale = drawn(this.svg, "g", { display: "none" });
    STOPS.slice(0, -1).forEach((_, k) =>
      [0, 1, 2, 3].forEach((part) =>
        drawn(this.scale, "rect", {
          x: -8,
          y: 80 - 5 * (4 * k + part + 1),
          width: 8,
          height: 5.5,
          fill: `color-mix(in srgb, ${STOPS[k]}, ${STOPS[k + 1]} ${25 * part}%)`,
        }),
      ),
    );
    for (const [y, text] of [
      [80, "0"],
      [8, "1"],
    ])
      drawn(this.scale, "text", { x: -12, y, "text-anchor": "end" }, text);
  }
  /* For a camera, pixels across and up and those up of one picture, and whether amplitudes are
     coloured. */
  draw(camera, target, [wide, high, pictured], coloured) {
    if (!this.axes || !pictured) return;
    const turn = camera.matrixWorldInverse.elements;
    const at = [38, high - 38];
    this.axes.forEach(({ line, text }, k) => {
      const [x, y] = [ARM * turn[4 * k], -ARM * turn[4 * k + 1]];
      const ends = { x1: at[0], y1: at[1], x2: at[0] + x, y2: at[1] + y };
      for (const [key, value] of Object.entries(ends)) line.setAttribute(key, value.toFixed(1));
      const far = 1 + 9 / Math.max(9, Math.hypot(x, y));
      text.setAttribute("x", (at[0] + far * x).toFixed(1));
      text.setAttribute("y", (at[1] + far * y + 4).toFixed(1));
    });
    const away = camera.position.distanceTo(target);
    const pixel = (2 * away * Math.tan((camera.fov * Math.PI) / 360)) / pictured;
    const most = WIDEST * pixel;
    const power = 10 ** Math.floor(Math.log10(most));
    const metres = [5, 2, 1].find((step) => step * power <= most) * power;
    const pixels = metres / pixel;
    this.length.setAttribute("d", `M${wide - 16 - pixels} ${high - 22}v6h${pixels}v-6`);
    this.words.textContent = metres < 1 ? `${+(1000 * metres).toPrecision(1)} mm` : `${metres} m`;
    this.words.setAttribute("x", wide - 16 - pixels / 2);
    this.words.setAttribute("y", high - 24);
    this.scale.setAttribute("display", coloured ? "inline" : "none");
    this.scale.setAttribute("transform", `translate(${wide - 14} 44)`);
  }
  /* The names that it has, and how large they are. */
  hold(names) {
    this.spans = names.map((name) => made("span", {}, name));
    this.labels.append(...this.spans);
    this.sizes = this.spans.map((span) => [span.offsetWidth, span.offsetHeight]);
  }
  /* Names at their places, nearest first; one that would cover another is left out. */
  name(places, first) {
    const taken = [];
    const order = places.map((_, k) => k);
    if (first >= 0) order.unshift(first);
    const done = new Set();
    for (const k of order) {
      if (done.has(k)) continue;
      done.add(k);
      const [x, y] = places[k];
      const [w, h] = this.sizes[k];
      const free = !taken.some(
        ([a, b, c, d]) => x < a + c && a < x + w && y < b + d && b < y + h,
      );
      if (free) taken.push([x, y, w, h]);
      this.spans[k].style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
      this.spans[k].style.visibility = free ? "" : "hidden";
    }
  }
}
