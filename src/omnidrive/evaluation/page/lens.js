"use strict";
/* A small view that moves with the reference and shows where the robots' centres are. */
class Lens {
  constructor(canvas) {
    this.camera = { x: 0, y: 0, scale: 1, width: 1, height: 1, toScreen: Camera.prototype.toScreen, toFloor: Camera.prototype.toFloor };
    this.scene = new Scene(canvas, this.camera);
  }

  /* Wide enough for every visible robot, by round steps so that it does not breathe. */
  draw(group, row) {
    const { camera, scene } = this;
    const { pen } = scene;
    const target = group.target.at(row);
    const shown = group.runs.filter((run) => run.visible);
    const far = shown.map((run) => run.at(row).distance).filter(Number.isFinite);
    const reach = Scene.round(Math.max(1.15 * Math.max(0, ...far), 1e-3));
    [camera.x, camera.y] = [target.x, target.y];
    camera.scale = (0.5 * camera.height - 14) / reach;
    pen.setTransform(scene.ratio, 0, 0, scene.ratio, 0, 0);
    pen.fillStyle = scene.colours.floor;
    pen.fillRect(0, 0, camera.width, camera.height);
    this.rings(reach);
    pen.strokeStyle = scene.colours.ink;
    pen.lineWidth = 1.2;
    pen.setLineDash([6, 4]);
    scene.line(group.target.x, group.target.y, Infinity);
    pen.setLineDash([]);
    for (const run of shown) {
      scene.drawTrail(run, row);
      this.centre(run, run.at(row));
    }
    this.cross();
    scene.drawScale();
  }

  /* Circles of equal error about the reference. */
  rings(reach) {
    const { camera, scene } = this;
    const { pen } = scene;
    pen.strokeStyle = scene.colours.grid;
    pen.lineWidth = 1;
    for (const share of [0.5, 1]) {
      pen.beginPath();
      pen.arc(0.5 * camera.width, 0.5 * camera.height, share * reach * camera.scale, 0, 2 * Math.PI);
      pen.stroke();
    }
  }

  centre(run, state) {
    const { camera, scene } = this;
    const { pen } = scene;
    const [x, y] = camera.toScreen(state.x, state.y);
    pen.fillStyle = pen.strokeStyle = run.colour();
    pen.beginPath();
    pen.arc(x, y, 5, 0, 2 * Math.PI);
    pen.fill();
    pen.lineWidth = 2;
    pen.beginPath();
    pen.moveTo(x, y);
    pen.lineTo(x + 17 * Math.cos(state.yaw), y - 17 * Math.sin(state.yaw));
    pen.stroke();
  }

  cross() {
    const { camera, scene } = this;
    const { pen } = scene;
    const [x, y] = [0.5 * camera.width, 0.5 * camera.height];
    pen.strokeStyle = scene.colours.ink;
    pen.lineWidth = 1.5;
    pen.beginPath();
    pen.moveTo(x - 8, y);
    pen.lineTo(x + 8, y);
    pen.moveTo(x, y - 8);
    pen.lineTo(x, y + 8);
    pen.stroke();
  }
}
