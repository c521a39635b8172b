"use strict";
/* Camera of the map view (x right, y up) and its mouse and touch gestures. */
class Camera {
  constructor(canvas) {
    this.canvas = canvas;
    this.x = 0;
    this.y = 0;
    this.scale = 50; // px per m
    this.width = 1; // CSS px
    this.height = 1;
    this.onMove = () => {};
    this.onDrag = () => {};
    this.locked = false; // while a robot is followed, zooming keeps the centre
    this.pointers = new Map();
    this.dragged = false;
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    for (const name of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(name, (event) => this.pointers.delete(event.pointerId));
    }
  }

  toScreen(x, y) {
    return [0.5 * this.width + (x - this.x) * this.scale, 0.5 * this.height - (y - this.y) * this.scale];
  }

  toWorld(px, py) {
    return [this.x + (px - 0.5 * this.width) / this.scale, this.y - (py - 0.5 * this.height) / this.scale];
  }

  /* Position of an event, px from the corner of the canvas. */
  position(event) {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  fit(box, margin = 0.04) {
    const width = box.right - box.left;
    const height = box.top - box.bottom;
    this.x = 0.5 * (box.left + box.right);
    this.y = 0.5 * (box.bottom + box.top);
    this.scale = (1 - margin) * Math.min(this.width / width, this.height / height);
    this.onMove();
  }

  /* Zoom by a factor about a point of the screen. */
  zoom(factor, px = 0.5 * this.width, py = 0.5 * this.height) {
    const [x, y] = this.toWorld(px, py);
    const scale = Math.min(Math.max(this.scale * factor, 2), 40000);
    const ratio = this.scale / scale;
    if (!this.locked) {
      this.x = x + (this.x - x) * ratio;
      this.y = y + (this.y - y) * ratio;
    }
    this.scale = scale;
    this.onMove();
  }

  pan(dx, dy) {
    this.x -= dx / this.scale;
    this.y += dy / this.scale;
    this.onMove();
  }

  wheel(event) {
    event.preventDefault();
    const unit = event.deltaMode === 1 ? 30 : 1; // lines or px
    this.zoom(Math.exp(-0.0016 * unit * event.deltaY), ...this.position(event));
  }

  down(event) {
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, this.position(event));
    this.dragged = false;
  }

  move(event) {
    const before = this.pointers.get(event.pointerId);
    if (before === undefined) return;
    const now = this.position(event);
    const others = [...this.pointers].filter(([id]) => id !== event.pointerId).map(([, at]) => at);
    this.pointers.set(event.pointerId, now);
    this.dragged = true;
    if (others.length === 0) {
      this.onDrag();
      this.pan(now[0] - before[0], now[1] - before[1]);
      return;
    }
    const other = others[0];
    const apart = (at) => Math.max(Math.hypot(at[0] - other[0], at[1] - other[1]), 1);
    const middle = (at) => [0.5 * (at[0] + other[0]), 0.5 * (at[1] + other[1])];
    const [a, b] = [middle(before), middle(now)];
    this.pan(b[0] - a[0], b[1] - a[1]);
    this.zoom(apart(now) / apart(before), ...b);
  }
}
