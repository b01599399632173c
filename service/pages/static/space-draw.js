/* A structure in space by WebGL: bodies, points and arrows whose motion the vertex shader computes;
   the camera; picking. */

const VERTEX = `
  attribute vec3 real; attribute vec3 imag;
  uniform float amplitude; uniform float cosine; uniform float sine; uniform float size;
  varying vec3 place; varying float far;
  void main() {
    far = length(sqrt(real * real + imag * imag));
    vec4 seen = modelViewMatrix * vec4(position + amplitude * (cosine * real - sine * imag), 1.0);
    place = seen.xyz;
    gl_Position = projectionMatrix * seen;
    gl_PointSize = size;
  }`;
const FRAGMENT = {
  surface: `
    uniform vec3 color; uniform float opacity; uniform bool scaled;
    varying vec3 place; varying float far;
    vec3 cividis(float t) {
      vec3 low = mix(vec3(0.0, 0.13, 0.31), vec3(0.49, 0.49, 0.47), min(1.0, 2.0 * t));
      return mix(low, vec3(1.0, 0.91, 0.22), max(0.0, 2.0 * t - 1.0));
    }
    void main() {
      vec3 normal = normalize(cross(dFdx(place), dFdy(place)));
      vec3 shade = scaled ? cividis(min(1.0, far)) : color;
      gl_FragColor = vec4(shade * (0.6 + 0.4 * abs(normal.z)), opacity);
    }`,
  line: "uniform vec3 color; uniform float opacity; void main() { gl_FragColor = vec4(color, opacity); }",
  point: `
    uniform vec3 color; uniform float opacity;
    void main() { vec2 off = gl_PointCoord - 0.5; if (dot(off, off) > 0.25) discard; gl_FragColor = vec4(color, opacity); }`,
};
const NEAR = 20; // CSS pixels around a point within which it is meant
const MOST_LABELS = 120; // of more points they would cover one another
const FIELD = 28; // degrees that the camera sees
const FROM = [0.4, -0.8, 0.5]; // where it stands at first

function rgb(text) {
  const hex = text.trim().replace(/^#(.)(.)(.)$/, "#$1$1$2$2$3$3");
  return [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16) / 255);
}
const triples = (three, values) =>
  new three.BufferAttribute(
    values instanceof Float32Array ? values : Float32Array.from(values),
    3,
  );
/* One picture of the structure, with a motion of its own; several share the arrays of their places.
 */
class Body {
  constructor(three, scene, rest) {
    this.three = three;
    this.scene = scene;
    this.rest = rest;
    this.group = new three.Group();
    this.motion = { amplitude: { value: 0 }, cosine: { value: 1 }, sine: { value: 0 } };
    this.moving = { nodes: [], points: [], arrows: [] };
  }
  material(kind, color, said = {}) {
    const still = { amplitude: { value: 0 }, cosine: { value: 1 }, sine: { value: 0 } };
    const opacity = said.opacity ?? 1;
    return new this.three.ShaderMaterial({
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT[kind],
      side: this.three.DoubleSide,
      transparent: opacity < 1,
      depthWrite: opacity === 1,
      polygonOffset: kind === "surface",
      polygonOffsetFactor: 1,
      polygonOffsetUnits: 1,
      uniforms: {
        ...(said.still ? still : this.motion),
        color: { value: rgb(color) },
        opacity: { value: opacity },
        scaled: { value: Boolean(said.scaled) },
        size: { value: said.size ?? 1 },
      },
    });
  }
  add(Kind, of, index, material) {
    if (!index.length) return null;
    const geometry = new this.three.BufferGeometry();
    geometry.setAttribute("position", this.rest[of]);
    const own = index instanceof Uint32Array ? index : Uint32Array.from(index);
    geometry.setIndex(new this.three.BufferAttribute(own, 1));
    const part = new Kind(geometry, material);
    part.frustumCulled = false; // its motion is not in its box
    this.moving[of].push(geometry);
    this.group.add(part);
    return part;
  }
  /* How the shape moves nodes and points; what has none stays. */
  move(shape, amplitude) {
    const { three } = this;
    const set = (geometries, motion, repeat) => {
      const spread = (values) => triples(three, repeat ? repeat(values) : values);
      const [real, imag] = motion ? [spread(motion.real), spread(motion.imag)] : [];
      for (const geometry of geometries)
        for (const [name, values] of [
          ["real", real],
          ["imag", imag],
        ]) {
          if (values) geometry.setAttribute(name, values);
          else geometry.deleteAttribute(name);
        }
    };
    this.shape = shape;
    this.reach = shape ? amplitude : 0;
    set(this.moving.nodes, shape?.nodes);
    set(this.moving.points, shape?.points);
    set(this.moving.arrows, shape?.points, (values) => {
      const ends = this.scene.arrows.flatMap(({ point }) => Array(6).fill(3 * point));
      return ends.flatMap((at) => [values[at], values[at + 1], values[at + 2]]);
    });
  }
  turn(phase, amplitude) {
    this.motion.amplitude.value = this.reach * amplitude;
    this.motion.cosine.value = Math.cos(phase);
    this.motion.sine.value = Math.sin(phase);
  }
  /* Where a point is now, as a vector that is there. */
  place(i, into) {
    into.fromArray(this.scene.positions, 3 * i);
    const { amplitude, cosine, sine } = this.motion;
    const moves = this.shape?.points;
    if (!moves) return into;
    for (let k = 0; k < 3; k += 1) {
      const along = cosine.value * moves.real[3 * i + k] - sine.value * moves.imag[3 * i + k];
      into.setComponent(k, into.getComponent(k) + amplitude.value * along);
    }
    return into;
  }
}
/* Arrows as three strokes each, from the points along the directions that were measured. */
function strokes(scene, length) {
  return scene.arrows.flatMap(({ point, along }) => {
    const from = [...scene.positions.slice(3 * point, 3 * point + 3)];
    const thin = Math.abs(along[2]) > 0.9 ? [1, 0, 0] : [0, 0, 1];
    const side = [
      along[1] * thin[2] - along[2] * thin[1],
      along[2] * thin[0] - along[0] * thin[2],
      along[0] * thin[1] - along[1] * thin[0],
    ];
    const at = (forth, aside) =>
      from.map((value, k) => value + length * (forth * along[k] + aside * side[k]));
    const tip = at(1, 0);
    return [...from, ...tip, ...tip, ...at(0.7, 0.12), ...tip, ...at(0.7, -0.12)];
  });
}
function bodyOf(three, scene, rest, colors, look) {
  const body = new Body(three, scene, rest);
  const { mesh } = scene;
  mesh.sets.forEach((set, i) => {
    const color = look.color ?? colors.sets[i % colors.sets.length];
    body.add(
      three.Mesh,
      "nodes",
      set.triangles,
      body.material("surface", color, { opacity: look.opacity, scaled: look.scaled }),
    );
    body.add(
      three.LineSegments,
      "nodes",
      set.wires,
      body.material("line", set.triangles.length ? look.wires : color, {
        opacity: look.moves ? 0.15 : 0.3,
      }),
    );
  });
  body.add(three.LineSegments, "nodes", mesh.outline, body.material("line", look.wires));
  if (look.moves)
    body.add(
      three.LineSegments,
      "nodes",
      mesh.outline,
      body.material("line", colors.hint, { still: true }),
    );
  body.add(three.LineSegments, "nodes", mesh.junctions, body.material("line", colors.initial));
  const dot = (color, size) => body.material("point", color, { size: size * devicePixelRatio });
  body.add(three.Points, "nodes", mesh.held, dot(colors.care, 6));
  body.add(three.Points, "nodes", mesh.masses, dot(colors.good, 9));
  if (!look.points) return body;
  const among = (test) =>
    scene.points.flatMap((point, i) =>
      test(point) && !point.bare && !(look.moves && point.held_out) ? [i] : [],
    );
  body.add(
    three.LineSegments,
    "points",
    scene.joined,
    body.material("line", colors.measured, { opacity: look.moves ? 1 : 0.5 }),
  );
  body.add(
    three.Points,
    "points",
    among((p) => !p.off && p.frfs !== 0),
    dot(colors.measured, 7),
  );
  body.add(
    three.Points,
    "points",
    among((p) => !p.off && p.frfs === 0),
    dot(colors.hint, 6),
  );
  body.add(
    three.Points,
    "points",
    among((p) => p.off),
    dot(colors.bad, 9),
  );
  if (scene.points.length) {
    body.marker = body.add(three.Points, "points", [0], dot(colors.initial, 14));
    body.marker.renderOrder = 2;
  }
  const which = (role) =>
    scene.arrows.flatMap((arrow, i) =>
      arrow.role === role ? [0, 1, 2, 3, 4, 5].map((k) => 6 * i + k) : [],
    );
  body.add(three.LineSegments, "arrows", which("response"), body.material("line", colors.measured));
  body.add(three.LineSegments, "arrows", which("reference"), body.material("line", colors.initial));
  return body;
}
/* The box around all there is, and the ball around that. */
function framed(three, scene) {
  const box = new three.Box3();
  for (const values of [scene.mesh.positions, scene.positions])
    if (values.length) box.union(new three.Box3().setFromArray(values));
  const ball = box.getBoundingSphere(new three.Sphere());
  return { box, centre: ball.center, radius: ball.radius || 1 };
}

export class Space {
  constructor(three, canvas, scene, colors, said) {
    Object.assign(this, { three, canvas, scene, colors, said });
    this.renderer = new three.WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.renderer.setPixelRatio(devicePixelRatio);
    this.renderer.autoClear = false;
    this.renderer.debug.checkShaderErrors = false; // which would wait for each in the first frame
    Object.assign(this, framed(three, scene));
    this.camera = new three.PerspectiveCamera(FIELD, 1, this.radius / 50, this.radius * 50);
    this.camera.up.set(0, 0, 1);
    this.controls = new three.OrbitControls(this.camera, canvas);
    this.controls.enableDamping = false;
    this.controls.enableZoom = false; // until somebody works here, the wheel moves the page
    this.controls.addEventListener("change", () => this.dirty(true));
    this.state = { amplitude: 0.5, phase: 0, speed: 1, running: false };
    this.bodies = [];
    this.beside = false;
    this.size = [0, 0];
    this.named = scene.points.flatMap(({ label }, i) => (label === "" ? [] : [i]));
    if (this.named.length > MOST_LABELS) this.named = [];
    said.frame.hold(this.named.map((i) => scene.points[i].label));
    this.build();
    new ResizeObserver(() => this.resize()).observe(canvas);
    new IntersectionObserver(([entry]) => {
      this.seen = entry.isIntersecting;
      this.dirty();
    }).observe(canvas);
    this.listen();
    this.resize();
    this.home();
  }
  build() {
    const { three, scene } = this;
    this.rest = {
      nodes: triples(three, scene.mesh.positions),
      points: triples(three, scene.positions),
      arrows: triples(three, strokes(scene, 0.09 * this.radius)),
    };
    this.show([]);
  }
  /* Pictures of the structure: at rest, or one for each of up to two shapes, beside or over each
     other. */
  show(shapes, beside = false) {
    const former = this.bodies.flatMap(({ group }) => group.children);
    for (const { geometry } of former) geometry.dispose();
    const { three, scene, rest, colors } = this;
    const over = shapes.length > 1 && !beside;
    const before = this.beside;
    this.beside = shapes.length > 1 && beside;
    const looks = shapes.map(({ measured, nodes }, i) => ({
      moves: true,
      points: measured,
      wires: measured ? colors.measured : colors.updated,
      color: measured ? colors.hint : colors.updated,
      opacity: over && i ? 0.35 : measured && over ? 0.3 : 1,
      scaled: !over && Boolean(nodes),
    }));
    const { sets } = scene.mesh;
    this.coloured = looks[0]?.scaled && sets.some((set) => set.triangles.length);
    if (!shapes.length) looks.push({ points: true, wires: colors.text });
    this.bodies = looks.map((look) => bodyOf(three, scene, rest, colors, look));
    this.bodies.forEach((body, i) => body.move(shapes[i], 0.2 * this.radius));
    this.scenes = this.bodies.map(({ group }) => {
      const made = new three.Scene();
      made.add(group);
      return made;
    });
    /* Programs and arrays get to the card here, and not in the first frame; programs of before stay
       until then, as the new pictures have them too. */
    for (const each of this.scenes) this.renderer.render(each, this.camera);
    for (const { material } of former) material.dispose();
    this.select(this.chosen ?? -1);
    this.resize();
    this.dirty(true);
    if (before !== this.beside) this.home();
  }
  /* Mark a point, by its number in the list; −1 marks none. */
  select(i) {
    this.chosen = i;
    for (const { marker } of this.bodies)
      if (marker) {
        marker.visible = i >= 0;
        marker.geometry.index.setX(0, Math.max(i, 0));
        marker.geometry.index.needsUpdate = true;
      }
    this.dirty();
  }
  set(changes) {
    Object.assign(this.state, changes);
    this.dirty();
  }
  /* Corners of the box, with room for motion and arrows, along the first view's back, right, up. */
  corners() {
    const { Vector3 } = this.three;
    const back = new Vector3(...FROM).normalize();
    const right = new Vector3(0, 0, 1).cross(back).normalize();
    const axes = [back, right, back.clone().cross(right)];
    const { min, max } = this.box.clone().expandByScalar(0.1 * this.radius);
    const found = [0, 1, 2, 3, 4, 5, 6, 7].map((i) =>
      new Vector3(i & 1 ? max.x : min.x, i & 2 ? max.y : min.y, i & 4 ? max.z : min.z).sub(
        this.centre,
      ),
    );
    return found.map((corner) => axes.map((axis) => corner.dot(axis)));
  }
  /* How far off the camera has all corners in sight, of a picture that is so wide for it. */
  away(aspect) {
    const high = Math.tan((FIELD * Math.PI) / 360);
    return Math.max(
      ...this.corners().map(
        ([back, right, up]) =>
          back + Math.max(Math.abs(right) / (high * aspect), Math.abs(up) / high),
      ),
    );
  }
  home() {
    this.touched = false;
    this.controls.target.copy(this.centre);
    this.camera.position
      .set(...FROM)
      .normalize()
      .multiplyScalar(1.03 * this.away(this.camera.aspect))
      .add(this.centre);
    this.controls.update();
    this.dirty(true);
  }
  /* Two pictures stand beside or above each other, as they are larger. */
  resize() {
    const { clientWidth: wide, clientHeight: high } = this.canvas;
    if (!wide || !high) return;
    this.size = [wide, high]; // asked for here alone: a frame would wait for the page's layout
    this.renderer.setSize(wide, high, false);
    const aspect = wide / high;
    this.stacked = this.beside && this.away(2 * aspect) < this.away(aspect / 2);
    this.camera.aspect = aspect * (this.beside ? (this.stacked ? 2 : 0.5) : 1);
    this.camera.updateProjectionMatrix();
    if (this.touched) this.dirty(true);
    else this.home();
  }
  /* Left, top, width and height of a picture in the canvas, CSS pixels. */
  cell(i) {
    const [wide, high] = this.size;
    if (!this.beside) return [0, 0, wide, high];
    return this.stacked
      ? [0, (i * high) / 2, wide, high / 2]
      : [(i * wide) / 2, 0, wide / 2, high];
  }
  /* To be drawn anew; `view`: what stands around the picture, too. */
  dirty(view = false) {
    this.framed &&= !view;
    this.frame ||= requestAnimationFrame((now) => this.draw(now));
  }
  draw(now) {
    this.frame = 0;
    const { state, bodies, renderer } = this;
    const passed = Math.min(0.1, (now - (this.last ?? now)) / 1000);
    this.last = now;
    if (state.running)
      state.phase = (state.phase + 2 * Math.PI * state.speed * passed) % (2 * Math.PI);
    renderer.setScissorTest(false);
    renderer.clear();
    const [, whole] = this.size;
    bodies.forEach((body, i) => {
      body.turn(state.phase, state.amplitude);
      const [left, top, wide, high] = this.cell(i);
      renderer.setViewport(left, whole - top - high, wide, high);
      renderer.render(this.scenes[i], this.camera);
    });
    this.label();
    if (state.running && this.seen && bodies.some(({ shape }) => shape)) this.dirty();
    else this.last = undefined;
  }
  /* Where points are seen, CSS pixels of the canvas. */
  seenAt(points) {
    const at = Math.max(
      0,
      this.bodies.findIndex(({ marker }) => marker),
    );
    const [left, top, wide, high] = this.cell(at);
    const place = (this.somewhere ??= new this.three.Vector3());
    return points.map((i) => {
      const { x, y } = this.bodies[at].place(i, place).project(this.camera);
      return [left + ((x + 1) / 2) * wide, top + ((1 - y) / 2) * high];
    });
  }
  label() {
    const { frame } = this.said;
    const pictured = this.cell(0)[3];
    if (!this.framed)
      frame.draw(this.camera, this.controls.target, [...this.size, pictured], this.coloured);
    this.framed = true;
    if (this.named.length) frame.name(this.seenAt(this.named), this.named.indexOf(this.chosen));
  }
  /* The point nearest to a place of the canvas, CSS pixels; −1 where none is near. */
  pick(x, y) {
    let best = -1,
      least = NEAR;
    this.seenAt([...this.scene.points.keys()]).forEach(([left, top], i) => {
      const away = Math.hypot(left - x, top - y);
      if (away < least) [best, least] = [i, away];
    });
    return best;
  }
  listen() {
    const { canvas, controls } = this;
    let down = null;
    controls.addEventListener("start", () => {
      this.touched = true;
    });
    canvas.addEventListener("pointerdown", (event) => {
      down = [event.offsetX, event.offsetY];
      canvas.focus({ preventScroll: true });
    });
    canvas.addEventListener("pointerup", (event) => {
      if (!down || Math.hypot(event.offsetX - down[0], event.offsetY - down[1]) > 4) return;
      const found = this.pick(event.offsetX, event.offsetY);
      if (found >= 0) this.said.chosen(found);
    });
    canvas.addEventListener("focus", () => {
      controls.enableZoom = true;
    });
    canvas.addEventListener("blur", () => {
      controls.enableZoom = false;
    });
    canvas.addEventListener("keydown", (event) => this.key(event));
  }
  key(event) {
    const { controls } = this;
    const count = this.scene.points.length;
    const across = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[
      event.key
    ];
    const does = {
      "+": () => controls.dollyIn(1.15),
      "=": () => controls.dollyIn(1.15),
      "-": () => controls.dollyOut(1.15),
      Home: () => this.home(),
      n: () => count && this.said.chosen((this.chosen + 1) % count),
      p: () => count && this.said.chosen((Math.max(this.chosen, 0) + count - 1) % count),
      " ": () => this.said.moved?.(),
    }[event.key];
    if (event.ctrlKey || event.metaKey || event.altKey || (!across && !does)) return;
    event.preventDefault();
    this.touched = true;
    if (does) does();
    else if (event.shiftKey) controls.pan(30 * across[0], 30 * across[1]);
    else if (across[0]) controls.rotateLeft(0.1 * across[0]);
    else controls.rotateUp(0.1 * across[1]);
  }
}
