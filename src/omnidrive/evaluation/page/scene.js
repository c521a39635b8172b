"use strict";
/* Drawing of the map and the robots. */
class Scene {
  constructor(canvas, camera) {
    this.canvas = canvas;
    this.camera = camera;
    this.ctx = canvas.getContext("2d");
    this.layers = { costs: true, zones: true, cells: true, inflated: true, trails: true, measured: true };
    this.recolour();
  }

  /* Match the canvas to its box on the page, in device pixels. */
  resize() {
    this.ratio = devicePixelRatio || 1;
    this.camera.width = this.canvas.clientWidth;
    this.camera.height = this.canvas.clientHeight;
    this.canvas.width = Math.round(this.camera.width * this.ratio);
    this.canvas.height = Math.round(this.camera.height * this.ratio);
  }

  recolour() {
    const names = ["ground", "inflated", "obstacle", "outside", "grid", "ink", "muted", "panel", "accent", "lane"];
    this.colours = Object.fromEntries(names.map((name) => [name, Theme.colour(name)]));
    this.picture = null; // rendered on the next draw
    this.overlays = null;
  }

  /* Render the map with one pixel per cell, top row first. */
  paintMap() {
    const { rows, cols, kinds } = Study.map;
    const picture = new OffscreenCanvas(cols, rows);
    const ctx = picture.getContext("2d");
    const { ground, inflated, obstacle } = this.colours;
    const pixelColours = [ground, this.layers.inflated ? inflated : ground, obstacle].map((c) => Scene.rgb(c));
    const image = ctx.createImageData(cols, rows);
    const pixels = new Uint32Array(image.data.buffer);
    for (let row = 0; row < rows; row++) {
      const start = (rows - 1 - row) * cols;
      for (let col = 0; col < cols; col++) pixels[start + col] = pixelColours[kinds[row * cols + col]];
    }
    ctx.putImageData(image, 0, 0);
    return picture;
  }

  /* Convert "#rrggbb" to a little-endian RGBA pixel. */
  static rgb(colour) {
    const [r, g, b] = [1, 3, 5].map((i) => parseInt(colour.slice(i, i + 2), 16));
    return ((255 << 24) | (b << 16) | (g << 8) | r) >>> 0;
  }

  draw(group, row, hovered) {
    this.drawGround(group.onMap);
    const shown = group.runs.filter((run) => run.visible);
    for (const run of shown) {
      if (run.measured && this.layers.measured) this.drawMeasured(run, row);
      if (this.layers.trails) this.drawTrail(run, row);
    }
    this.drawTarget(group.target.at(row));
    for (const run of shown) this.drawRobot(run, run.at(row), run === hovered);
    this.drawScale();
  }

  /* Everything below the robots. */
  drawGround(onMap) {
    const { ctx, camera } = this;
    ctx.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    ctx.fillStyle = onMap ? this.colours.outside : this.colours.ground;
    ctx.fillRect(0, 0, camera.width, camera.height);
    if (onMap) this.drawMap();
    this.drawGrid();
    if (onMap) this.drawPath();
  }

  drawMap() {
    const { ctx, camera } = this;
    this.picture ??= this.paintMap();
    const { rows, cols, resolution, size, x, y, yaw } = Study.map;
    const { scale } = camera;
    const box = [0, -size[1] * scale, size[0] * scale, size[1] * scale];
    const side = resolution * scale;
    ctx.save();
    ctx.translate(...camera.toScreen(x, y));
    ctx.rotate(-yaw); // the screen's y axis points down
    ctx.imageSmoothingEnabled = false;
    ctx.save();
    ctx.beginPath();
    ctx.rect(...box); // the last cells of a reduced map reach beyond it
    ctx.clip();
    ctx.drawImage(this.picture, 0, -rows * side, cols * side, rows * side);
    if (MapLayers.ready()) this.drawOverlays();
    ctx.restore();
    ctx.strokeStyle = this.colours.obstacle;
    ctx.lineWidth = 1;
    ctx.strokeRect(...box);
    ctx.restore();
    if (MapLayers.ready() && this.layers.zones) this.drawLanes();
  }

  /* Costs and zones, in the frame of the map. */
  drawOverlays() {
    const { ctx, camera } = this;
    this.overlays ??= MapLayers.pictures();
    const [width, height] = MapLayers.size().map((length) => length * camera.scale);
    for (const name of ["costs", "zones"]) {
      if (this.layers[name] && this.overlays[name]) ctx.drawImage(this.overlays[name], 0, -height, width, height);
    }
  }

  /* Arrows along the lanes, on a grid of the world at least 24 px wide. */
  drawLanes() {
    if (!Study.layers.lanes) return;
    const { ctx, camera } = this;
    const step = Scene.round(24 / camera.scale);
    const [left, top] = camera.toWorld(0, 0);
    const [right, bottom] = camera.toWorld(camera.width, camera.height);
    ctx.strokeStyle = ctx.fillStyle = this.colours.lane;
    for (let x = Math.ceil(left / step) * step; x < right; x += step) {
      for (let y = Math.ceil(bottom / step) * step; y < top; y += step) {
        const heading = MapLayers.lane(x, y);
        if (Number.isNaN(heading)) continue;
        ctx.save();
        ctx.translate(...camera.toScreen(x, y));
        ctx.rotate(-heading);
        ctx.translate(-9, 0);
        this.drawArrow(18, 1.5);
        ctx.restore();
      }
    }
  }

  /* Grid lines at round coordinates, at least 70 px apart. */
  drawGrid() {
    const { ctx, camera } = this;
    const step = Scene.round(70 / camera.scale);
    const [left, top] = camera.toWorld(0, 0);
    const [right, bottom] = camera.toWorld(camera.width, camera.height);
    const multiples = (low, high) =>
      Array.from({ length: Math.floor(high / step) - Math.ceil(low / step) + 1 }, (_, k) => (Math.ceil(low / step) + k) * step);
    const columns = multiples(left, right).map((x) => [x, Math.round(camera.toScreen(x, 0)[0]) + 0.5]);
    const rows = multiples(bottom, top).map((y) => [y, Math.round(camera.toScreen(0, y)[1]) + 0.5]);
    ctx.lineWidth = 1;
    ctx.strokeStyle = this.colours.grid;
    ctx.beginPath();
    for (const [, px] of columns) {
      ctx.moveTo(px, 0);
      ctx.lineTo(px, camera.height);
    }
    for (const [, py] of rows) {
      ctx.moveTo(0, py);
      ctx.lineTo(camera.width, py);
    }
    ctx.stroke();
    this.drawCoordinates(columns, rows, Math.max(0, -Math.floor(Math.log10(step) + 1e-9)));
  }

  drawCoordinates(columns, rows, digits) {
    const { ctx, camera } = this;
    ctx.fillStyle = this.colours.muted;
    ctx.font = "11px system-ui, sans-serif";
    for (const [x, px] of columns) {
      if (px > 40 && px < camera.width - 110) this.write(x.toFixed(digits), px, camera.height - 7, "center");
    }
    for (const [y, py] of rows) {
      if (py > 12 && py < camera.height - 24) this.write(y.toFixed(digits), 6, py + 4, "left");
    }
  }

  /* Line from the pointer to the robot whose values are shown. */
  drawLeader(pointer, state) {
    const { ctx } = this;
    ctx.strokeStyle = this.colours.muted;
    ctx.lineWidth = 1;
    ctx.setLineDash([2, 3]);
    ctx.beginPath();
    ctx.moveTo(...pointer);
    ctx.lineTo(...this.camera.toScreen(state.x, state.y));
    ctx.stroke();
    ctx.setLineDash([]);
  }

  /* Text with an outline in the background colour. */
  write(text, x, y, align) {
    const { ctx } = this;
    ctx.save();
    ctx.textAlign = align;
    ctx.lineWidth = 3;
    ctx.lineJoin = "round";
    ctx.strokeStyle = this.colours.ground;
    ctx.strokeText(text, x, y);
    ctx.fillText(text, x, y);
    ctx.restore();
  }

  /* The smallest of 1, 2, 5 times a power of ten that is not below the value. */
  static round(value) {
    const power = 10 ** Math.floor(Math.log10(value));
    return power * [1, 2, 5, 10].find((digit) => digit * power >= value * (1 - 1e-9));
  }

  drawPath() {
    const { ctx, camera } = this;
    if (this.layers.cells) {
      ctx.fillStyle = this.colours.muted;
      const [xs, ys] = Study.cells;
      const side = Math.min(Math.max(0.5 * Study.map.resolution * camera.scale, 1.5), 4);
      xs.forEach((x, k) => {
        const [px, py] = camera.toScreen(x, ys[k]);
        ctx.fillRect(px - 0.5 * side, py - 0.5 * side, side, side);
      });
    }
    ctx.strokeStyle = this.colours.ink;
    ctx.lineWidth = 1.5;
    ctx.setLineDash([6, 4]);
    this.line(Study.spline[0], Study.spline[1], Infinity);
    ctx.setLineDash([]);
  }

  /* Polyline through the first rows of two columns; the last row may be fractional. */
  line(xs, ys, row) {
    const { ctx, camera } = this;
    const last = Math.min(Math.floor(row), xs.length - 1);
    ctx.beginPath();
    for (let k = 0; k <= last; k++) ctx.lineTo(...camera.toScreen(xs[k], ys[k]));
    if (last < xs.length - 1) {
      const share = row - last;
      const x = xs[last] + share * (xs[last + 1] - xs[last]);
      const y = ys[last] + share * (ys[last + 1] - ys[last]);
      ctx.lineTo(...camera.toScreen(x, y));
    }
    ctx.stroke();
  }

  drawTrail(run, row) {
    const { ctx } = this;
    ctx.strokeStyle = run.colour();
    ctx.lineWidth = 2.2;
    ctx.lineJoin = "round";
    this.line(run.x, run.y, row);
  }

  drawMeasured(run, row) {
    const { ctx, camera } = this;
    const [xs, ys] = run.measured;
    ctx.fillStyle = run.colour();
    ctx.globalAlpha = 0.55;
    for (let k = 0; k <= Math.min(row, xs.length - 1); k++) {
      const [x, y] = camera.toScreen(xs[k], ys[k]);
      ctx.fillRect(x - 1.2, y - 1.2, 2.4, 2.4);
    }
    ctx.globalAlpha = 1;
  }

  /* Adds the robot's outline, or its body circle without one, at the origin, x to the right. */
  traceBody() {
    const { ctx, camera } = this;
    const { bodyRadius, outline } = Study.robot;
    if (!outline) {
      ctx.arc(0, 0, bodyRadius * camera.scale, 0, 2 * Math.PI);
      return;
    }
    for (const [x, y] of outline) ctx.lineTo(x * camera.scale, -y * camera.scale);
    ctx.closePath();
  }

  /* Reference pose: the dashed body with a cross at its centre. */
  drawTarget(target) {
    const { ctx, camera } = this;
    const [x, y] = camera.toScreen(target.x, target.y);
    const size = Study.robot.bodyRadius * camera.scale;
    ctx.strokeStyle = this.colours.ink;
    ctx.lineWidth = 1.2;
    ctx.setLineDash([5, 4]);
    ctx.save();
    ctx.translate(x, y);
    ctx.rotate(-target.yaw);
    ctx.beginPath();
    this.traceBody();
    ctx.moveTo(0, 0);
    ctx.lineTo(size, 0);
    ctx.stroke();
    ctx.restore();
    ctx.setLineDash([]);
    ctx.beginPath();
    ctx.moveTo(x - 7, y);
    ctx.lineTo(x + 7, y);
    ctx.moveTo(x, y - 7);
    ctx.lineTo(x, y + 7);
    ctx.stroke();
  }

  /* Body, wheels and heading arrow, to scale. */
  drawRobot(run, state, hovered) {
    const { ctx, camera } = this;
    const { bodyRadius, wheelRadius, wheels } = Study.robot;
    const size = bodyRadius * camera.scale;
    const colour = run.colour();
    ctx.save();
    ctx.translate(...camera.toScreen(state.x, state.y));
    ctx.rotate(-state.yaw);
    ctx.fillStyle = ctx.strokeStyle = colour;
    ctx.lineWidth = hovered ? 3.5 : 2;
    ctx.beginPath();
    this.traceBody();
    ctx.globalAlpha = 0.08;
    ctx.fill();
    ctx.globalAlpha = 1;
    ctx.stroke();
    const half = Math.max(wheelRadius * camera.scale, 3);
    for (const { x, y, axle, roller } of wheels) {
      ctx.save();
      ctx.translate(x * camera.scale, -y * camera.scale);
      ctx.rotate(-axle);
      ctx.fillRect(-0.45 * half, -half, 0.9 * half, 2 * half);
      if (roller !== 0) this.drawRollers(half, roller);
      ctx.restore();
    }
    this.drawArrow(0.78 * size);
    ctx.restore();
  }

  /* Uppermost rollers of a mecanum wheel that rolls upwards on the screen. */
  drawRollers(half, roller) {
    const { ctx } = this;
    const slope = Math.cos(roller) / Math.sin(roller);
    ctx.save();
    ctx.strokeStyle = this.colours.panel;
    ctx.lineWidth = Math.max(0.12 * half, 1);
    ctx.beginPath();
    ctx.rect(-0.45 * half, -half, 0.9 * half, 2 * half);
    ctx.clip();
    ctx.beginPath();
    for (const middle of [-1, -0.5, 0, 0.5, 1]) {
      ctx.moveTo(-0.5 * half, (middle - 0.5 * slope) * half);
      ctx.lineTo(0.5 * half, (middle + 0.5 * slope) * half);
    }
    ctx.stroke();
    ctx.restore();
  }

  drawArrow(length, width = 2.5) {
    const { ctx } = this;
    const head = Math.min(0.35 * length, 11);
    ctx.lineWidth = width;
    ctx.beginPath();
    ctx.moveTo(0, 0);
    ctx.lineTo(length - 0.8 * head, 0);
    ctx.stroke();
    ctx.beginPath();
    ctx.moveTo(length, 0);
    ctx.lineTo(length - head, 0.55 * head);
    ctx.lineTo(length - head, -0.55 * head);
    ctx.fill();
    ctx.beginPath();
    ctx.arc(0, 0, 1.2 * width, 0, 2 * Math.PI);
    ctx.fill();
  }

  /* Scale bar of round length in the lower right corner. */
  drawScale() {
    const { ctx, camera } = this;
    const length = Scene.round(36 / camera.scale);
    const right = camera.width - 14;
    const left = right - length * camera.scale;
    const y = camera.height - 14;
    const text = length >= 1 ? `${length} m` : length >= 0.01 ? `${+(length * 100).toPrecision(2)} cm` : `${+(length * 1000).toPrecision(2)} mm`;
    ctx.strokeStyle = this.colours.ink;
    ctx.fillStyle = this.colours.ink;
    ctx.lineWidth = 2;
    ctx.beginPath();
    ctx.moveTo(left, y - 5);
    ctx.lineTo(left, y);
    ctx.lineTo(right, y);
    ctx.lineTo(right, y - 5);
    ctx.stroke();
    ctx.font = "11px system-ui, sans-serif";
    this.write(text, 0.5 * (left + right), y - 7, "center");
  }
}
