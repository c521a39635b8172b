"use strict";
/* Magnified view, centred on the reference, of the robot centres. */
class Lens {
  constructor(canvas) {
    this.camera = { x: 0, y: 0, scale: 1, width: 1, height: 1, toScreen: Camera.prototype.toScreen, toWorld: Camera.prototype.toWorld };
    this.scene = new Scene(canvas, this.camera);
  }

  /* The scale shows every visible robot; it changes in steps of 1, 2, 5, not continuously. */
  draw(group, row) {
    const { camera, scene } = this;
    const { ctx } = scene;
    const target = group.target.at(row);
    const shown = group.runs.filter((run) => run.visible);
    const errors = shown.map((run) => run.at(row).distance).filter(Number.isFinite);
    const radius = Scene.round(Math.max(1.15 * Math.max(0, ...errors), 1e-3));
    [camera.x, camera.y] = [target.x, target.y];
    camera.scale = (0.5 * camera.height - 14) / radius;
    ctx.setTransform(scene.ratio, 0, 0, scene.ratio, 0, 0);
    ctx.fillStyle = scene.colours.ground;
    ctx.fillRect(0, 0, camera.width, camera.height);
    this.rings(radius);
    ctx.strokeStyle = scene.colours.ink;
    ctx.lineWidth = 1.2;
    ctx.setLineDash([6, 4]);
    scene.line(group.target.x, group.target.y, Infinity);
    ctx.setLineDash([]);
    for (const run of shown) {
      scene.drawTrail(run, row);
      this.centre(run, run.at(row));
    }
    this.cross();
    scene.drawScale();
  }

  /* Circles of equal error about the reference. */
  rings(radius) {
    const { camera, scene } = this;
    const { ctx } = scene;
    ctx.strokeStyle = scene.colours.grid;
    ctx.lineWidth = 1;
    for (const fraction of [0.5, 1]) {
      ctx.beginPath();
      ctx.arc(0.5 * camera.width, 0.5 * camera.height, fraction * radius * camera.scale, 0, 2 * Math.PI);
      ctx.stroke();
    }
  }

  centre(run, state) {
    const { camera, scene } = this;
    const { ctx } = scene;
    const [x, y] = camera.toScreen(state.x, state.y);
    ctx.fillStyle = ctx.strokeStyle = run.colour();
    ctx.beginPath();
    ctx.arc(x, y, 5, 0, 2 * Math.PI);
    ctx.fill();
    ctx.lineWidth = 2;
    ctx.beginPath();
    ctx.moveTo(x, y);
    ctx.lineTo(x + 17 * Math.cos(state.yaw), y - 17 * Math.sin(state.yaw));
    ctx.stroke();
  }

  cross() {
    const { camera, scene } = this;
    const { ctx } = scene;
    const [x, y] = [0.5 * camera.width, 0.5 * camera.height];
    ctx.strokeStyle = scene.colours.ink;
    ctx.lineWidth = 1.5;
    ctx.beginPath();
    ctx.moveTo(x - 8, y);
    ctx.lineTo(x + 8, y);
    ctx.moveTo(x, y - 8);
    ctx.lineTo(x, y + 8);
    ctx.stroke();
  }
}
