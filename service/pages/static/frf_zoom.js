"use strict";
/* The band that a viewer shows: moved and made narrower or wider by wheel, fingers, keys and
   buttons. */
class FrfZoom {
  constructor(view, band) {
    this.view = view;
    this.band = band;
    this.whole = [0, 1];
    this.pending = 0;
    this.touches = new Map();
  }
  get seen() {
    return this.band ?? this.whole;
  }

  /* Moving is drawn once a frame with the scale of y as it is; at rest y fits what is seen. */
  to(low, high, moving = false) {
    if (!this.view.curves.length) return; // of what there is nothing, there is no part
    const [first, last] = this.whole;
    const wide = Math.min(Math.max(high - low, (last - first) * 1e-4), last - first);
    low = Math.min(Math.max(first, (low + high - wide) / 2), last - wide);
    this.band = wide >= last - first ? null : [low, low + wide];
    if (!this.pending) this.pending = requestAnimationFrame(() => this.draw(moving));
    clearTimeout(this.rest);
    this.rest = setTimeout(
      () => {
        this.view.panels.forEach((panel) => panel.fit());
        this.view.remember();
      },
      moving ? 150 : 0,
    );
  }
  draw(moving) {
    this.pending = 0;
    const began = performance.now();
    this.view.panels.forEach((panel) => panel.redraw(moving));
    this.view.box.dataset.frame = (performance.now() - began).toFixed(1);
  }
  by(factor, middle) {
    const [low, high] = this.seen;
    const m = middle ?? (low + high) / 2;
    this.to(m - (m - low) * factor, m + (high - m) * factor, true);
  }
  shift(share) {
    const [low, high] = this.seen;
    this.to(low + share * (high - low), high + share * (high - low), true);
  }

  /* Wheel, fingers and clicks of a panel: they zoom, and place the cursors. */
  listen(panel) {
    if (panel.kind.across) return;
    const { over } = panel.plot;
    const hzAt = (x) => panel.plot.posToVal(x - over.getBoundingClientRect().left, "x");
    let pressed = null;
    const released = (event) => this.touches.delete(event.pointerId);
    over.addEventListener(
      "wheel",
      (event) => {
        event.preventDefault();
        this.wheel(event, hzAt);
      },
      { passive: false },
    );
    over.addEventListener("pointerdown", (event) => {
      pressed = event.clientX;
      if (event.pointerType === "touch") this.touches.set(event.pointerId, event.clientX);
    });
    over.addEventListener("pointermove", (event) => {
      if (this.touches.has(event.pointerId)) this.touch(event, over.clientWidth, hzAt);
    });
    over.addEventListener("pointerup", (event) => {
      released(event);
      const { offsetX, offsetY } = event;
      const mode =
        panel === this.view.panels[0] && this.view.cursors.modeAt(offsetX, offsetY, panel);
      if (mode) tell("choose-mode", mode);
      else if (pressed !== null && Math.abs(event.clientX - pressed) < 4)
        this.view.cursors.to(hzAt(event.clientX), event.shiftKey ? 1 : undefined);
      pressed = null;
    });
    over.addEventListener("pointercancel", released);
    over.addEventListener("dblclick", () => this.to(...this.whole));
  }
  wheel(event, hzAt) {
    if (event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY))
      this.shift((event.deltaX || event.deltaY) / 1500);
    else this.by(event.deltaY > 0 ? 1.2 : 1 / 1.2, hzAt(event.clientX));
  }
  /* One finger moves the band, two make it narrower or wider. */
  touch(event, width, hzAt) {
    const before = [...this.touches.values()];
    this.touches.set(event.pointerId, event.clientX);
    const after = [...this.touches.values()];
    if (after.length === 1) this.shift((before[0] - after[0]) / width);
    else
      this.by(
        Math.abs(before[0] - before[1]) / Math.max(1, Math.abs(after[0] - after[1])),
        hzAt((after[0] + after[1]) / 2),
      );
  }
}
