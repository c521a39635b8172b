"use strict";
/* Draws the floor and the robots on it. */
class Scene {
  constructor(canvas, camera) {
    this.canvas = canvas;
    this.camera = camera;
    this.pen = canvas.getContext("2d");
    this.layers = { cells: true, inflated: true, trails: true, measured: true };
    this.recolour();
  }

  /* Match the canvas to its box on the page, in real pixels. */
  resize() {
    this.ratio = devicePixelRatio || 1;
    this.camera.width = this.canvas.clientWidth;
    this.camera.height = this.canvas.clientHeight;
    this.canvas.width = Math.round(this.camera.width * this.ratio);
    this.canvas.height = Math.round(this.camera.height * this.ratio);
  }

  recolour() {
    const names = ["floor", "inflated", "obstacle", "outside", "grid", "ink", "muted", "panel"];
    this.colours = Object.fromEntries(names.map((name) => [name, Theme.colour(name)]));
    this.picture = null; // painted when first needed
  }

  /* The map as a picture with one pixel per cell, its top row first. */
  paintMap() {
    const { rows, cols, kinds } = Study.map;
    const picture = new OffscreenCanvas(cols, rows);
    const pen = picture.getContext("2d");
    const { floor, inflated, obstacle } = this.colours;
    const inks = [floor, this.layers.inflated ? inflated : floor, obstacle].map((c) => Scene.rgb(c));
    const image = pen.createImageData(cols, rows);
    const pixels = new Uint32Array(image.data.buffer);
    for (let row = 0; row < rows; row++) {
      const start = (rows - 1 - row) * cols;
      for (let col = 0; col < cols; col++) pixels[start + col] = inks[kinds[row * cols + col]];
    }
    pen.putImageData(image, 0, 0);
    return picture;
  }

  /* "#rrggbb" as the little-endian pixel of an opaque canvas. */
  static rgb(colour) {
    const [r, g, b] = [1, 3, 5].map((i) => parseInt(colour.slice(i, i + 2), 16));
    return ((255 << 24) | (b << 16) | (g << 8) | r) >>> 0;
  }

  draw(group, row, hovered) {
    const { pen, camera } = this;
    pen.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    pen.fillStyle = group.onMap ? this.colours.outside : this.colours.floor;
    pen.fillRect(0, 0, camera.width, camera.height);
    if (group.onMap) this.drawMap();
    this.drawGrid();
    if (group.onMap) this.drawPath();
    const shown = group.runs.filter((run) => run.visible);
    for (const run of shown) {
      if (run.measured && this.layers.measured) this.drawMeasured(run, row);
      if (this.layers.trails) this.drawTrail(run, row);
    }
    this.drawTarget(group.target.at(row));
    for (const run of shown) this.drawRobot(run, run.at(row), run === hovered);
    this.drawScale();
  }

  drawMap() {
    const { pen, camera } = this;
    this.picture ??= this.paintMap();
    const { rows, cols, resolution, x, y, yaw } = Study.map;
    const side = resolution * camera.scale;
    const box = [0, -rows * side, cols * side, rows * side];
    pen.save();
    pen.translate(...camera.toScreen(x, y));
    pen.rotate(-yaw); // the screen's y axis points down
    pen.imageSmoothingEnabled = false;
    pen.drawImage(this.picture, ...box);
    pen.strokeStyle = this.colours.obstacle;
    pen.lineWidth = 1;
    pen.strokeRect(...box);
    pen.restore();
  }

  /* Lines at round coordinates, at least 70 px apart. */
  drawGrid() {
    const { pen, camera } = this;
    const step = Scene.round(70 / camera.scale);
    const [left, top] = camera.toFloor(0, 0);
    const [right, bottom] = camera.toFloor(camera.width, camera.height);
    const multiples = (low, high) =>
      Array.from({ length: Math.floor(high / step) - Math.ceil(low / step) + 1 }, (_, k) => (Math.ceil(low / step) + k) * step);
    const columns = multiples(left, right).map((x) => [x, Math.round(camera.toScreen(x, 0)[0]) + 0.5]);
    const rows = multiples(bottom, top).map((y) => [y, Math.round(camera.toScreen(0, y)[1]) + 0.5]);
    pen.lineWidth = 1;
    pen.strokeStyle = this.colours.grid;
    pen.beginPath();
    for (const [, px] of columns) {
      pen.moveTo(px, 0);
      pen.lineTo(px, camera.height);
    }
    for (const [, py] of rows) {
      pen.moveTo(0, py);
      pen.lineTo(camera.width, py);
    }
    pen.stroke();
    this.drawCoordinates(columns, rows, Math.max(0, -Math.floor(Math.log10(step) + 1e-9)));
  }

  drawCoordinates(columns, rows, digits) {
    const { pen, camera } = this;
    pen.fillStyle = this.colours.muted;
    pen.font = "11px system-ui, sans-serif";
    for (const [x, px] of columns) {
      if (px > 40 && px < camera.width - 110) this.write(x.toFixed(digits), px, camera.height - 7, "center");
    }
    for (const [y, py] of rows) {
      if (py > 12 && py < camera.height - 24) this.write(y.toFixed(digits), 6, py + 4, "left");
    }
  }

  /* From the pointer to the robot that its values belong to. */
  drawLeader(pointer, state) {
    const { pen } = this;
    pen.strokeStyle = this.colours.muted;
    pen.lineWidth = 1;
    pen.setLineDash([2, 3]);
    pen.beginPath();
    pen.moveTo(...pointer);
    pen.lineTo(...this.camera.toScreen(state.x, state.y));
    pen.stroke();
    pen.setLineDash([]);
  }

  /* Text with a halo, so that it reads on any ground. */
  write(text, x, y, align) {
    const { pen } = this;
    pen.save();
    pen.textAlign = align;
    pen.lineWidth = 3;
    pen.lineJoin = "round";
    pen.strokeStyle = this.colours.floor;
    pen.strokeText(text, x, y);
    pen.fillText(text, x, y);
    pen.restore();
  }

  /* 1, 2 or 5 times a power of ten, not below a value. */
  static round(value) {
    const power = 10 ** Math.floor(Math.log10(value));
    return power * [1, 2, 5, 10].find((digit) => digit * power >= value * (1 - 1e-9));
  }

  drawPath() {
    const { pen, camera } = this;
    if (this.layers.cells) {
      pen.fillStyle = this.colours.muted;
      const [xs, ys] = Study.cells;
      xs.forEach((x, k) => {
        const [px, py] = camera.toScreen(x, ys[k]);
        pen.fillRect(px - 2, py - 2, 4, 4);
      });
    }
    pen.strokeStyle = this.colours.ink;
    pen.lineWidth = 1.5;
    pen.setLineDash([6, 4]);
    this.line(Study.spline[0], Study.spline[1], Infinity);
    pen.setLineDash([]);
  }

  /* A line through the first rows of two columns, the last row perhaps a fraction. */
  line(xs, ys, row) {
    const { pen, camera } = this;
    const last = Math.min(Math.floor(row), xs.length - 1);
    pen.beginPath();
    for (let k = 0; k <= last; k++) pen.lineTo(...camera.toScreen(xs[k], ys[k]));
    if (last < xs.length - 1) {
      const share = row - last;
      const x = xs[last] + share * (xs[last + 1] - xs[last]);
      const y = ys[last] + share * (ys[last + 1] - ys[last]);
      pen.lineTo(...camera.toScreen(x, y));
    }
    pen.stroke();
  }

  drawTrail(run, row) {
    const { pen } = this;
    pen.strokeStyle = run.colour();
    pen.lineWidth = 2.2;
    pen.lineJoin = "round";
    this.line(run.x, run.y, row);
  }

  drawMeasured(run, row) {
    const { pen, camera } = this;
    const [xs, ys] = run.measured;
    pen.fillStyle = run.colour();
    pen.globalAlpha = 0.55;
    for (let k = 0; k <= Math.min(row, xs.length - 1); k++) {
      const [x, y] = camera.toScreen(xs[k], ys[k]);
      pen.fillRect(x - 1.2, y - 1.2, 2.4, 2.4);
    }
    pen.globalAlpha = 1;
  }

  /* The reference: a dashed body and a cross at its centre. */
  drawTarget(target) {
    const { pen, camera } = this;
    const [x, y] = camera.toScreen(target.x, target.y);
    const size = Study.robot.bodyRadius * camera.scale;
    pen.strokeStyle = this.colours.ink;
    pen.lineWidth = 1.2;
    pen.setLineDash([5, 4]);
    pen.beginPath();
    pen.arc(x, y, size, 0, 2 * Math.PI);
    pen.moveTo(x, y);
    pen.lineTo(x + size * Math.cos(target.yaw), y - size * Math.sin(target.yaw));
    pen.stroke();
    pen.setLineDash([]);
    pen.beginPath();
    pen.moveTo(x - 7, y);
    pen.lineTo(x + 7, y);
    pen.moveTo(x, y - 7);
    pen.lineTo(x, y + 7);
    pen.stroke();
  }

  /* Body circle, wheels and an arrow along the heading; to scale. */
  drawRobot(run, state, hovered) {
    const { pen, camera } = this;
    const { bodyRadius, wheelRadius, wheels } = Study.robot;
    const size = bodyRadius * camera.scale;
    const colour = run.colour();
    pen.save();
    pen.translate(...camera.toScreen(state.x, state.y));
    pen.rotate(-state.yaw);
    pen.fillStyle = pen.strokeStyle = colour;
    pen.lineWidth = hovered ? 3.5 : 2;
    pen.beginPath();
    pen.arc(0, 0, size, 0, 2 * Math.PI);
    pen.globalAlpha = 0.08;
    pen.fill();
    pen.globalAlpha = 1;
    pen.stroke();
    const half = Math.max(wheelRadius * camera.scale, 3);
    for (const { x, y, axle, roller } of wheels) {
      pen.save();
      pen.translate(x * camera.scale, -y * camera.scale);
      pen.rotate(-axle);
      pen.fillRect(-0.45 * half, -half, 0.9 * half, 2 * half);
      if (roller !== 0) this.drawRollers(half, roller);
      pen.restore();
    }
    this.drawArrow(0.78 * size);
    pen.restore();
  }

  /* The topmost rollers of a mecanum wheel, whose rolling is up on the screen. */
  drawRollers(half, roller) {
    const { pen } = this;
    const slope = Math.cos(roller) / Math.sin(roller);
    pen.save();
    pen.strokeStyle = this.colours.panel;
    pen.lineWidth = Math.max(0.12 * half, 1);
    pen.beginPath();
    pen.rect(-0.45 * half, -half, 0.9 * half, 2 * half);
    pen.clip();
    pen.beginPath();
    for (const middle of [-1, -0.5, 0, 0.5, 1]) {
      pen.moveTo(-0.5 * half, (middle - 0.5 * slope) * half);
      pen.lineTo(0.5 * half, (middle + 0.5 * slope) * half);
    }
    pen.stroke();
    pen.restore();
  }

  drawArrow(length) {
    const { pen } = this;
    const head = Math.min(0.35 * length, 11);
    pen.lineWidth = 2.5;
    pen.beginPath();
    pen.moveTo(0, 0);
    pen.lineTo(length - 0.8 * head, 0);
    pen.stroke();
    pen.beginPath();
    pen.moveTo(length, 0);
    pen.lineTo(length - head, 0.55 * head);
    pen.lineTo(length - head, -0.55 * head);
    pen.fill();
    pen.beginPath();
    pen.arc(0, 0, 3, 0, 2 * Math.PI);
    pen.fill();
  }

  /* A bar of round length in the lower right corner. */
  drawScale() {
    const { pen, camera } = this;
    const length = Scene.round(36 / camera.scale);
    const right = camera.width - 14;
    const left = right - length * camera.scale;
    const y = camera.height - 14;
    const text = length >= 1 ? `${length} m` : length >= 0.01 ? `${+(length * 100).toPrecision(2)} cm` : `${+(length * 1000).toPrecision(2)} mm`;
    pen.strokeStyle = this.colours.ink;
    pen.fillStyle = this.colours.ink;
    pen.lineWidth = 2;
    pen.beginPath();
    pen.moveTo(left, y - 5);
    pen.lineTo(left, y);
    pen.lineTo(right, y);
    pen.lineTo(right, y - 5);
    pen.stroke();
    pen.font = "11px system-ui, sans-serif";
    this.write(text, 0.5 * (left + right), y - 7, "center");
  }
}
