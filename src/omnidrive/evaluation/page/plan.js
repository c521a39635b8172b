"use strict";
/* Map and chart of the planned motion, linked by one point of the path: the row of its columns. */
const PlanView = (() => {
  const find = (id) => document.getElementById(`plan-${id}`);
  const { plan } = Study;
  const canvas = find("map");
  const camera = new Camera(canvas);
  const scene = new Scene(canvas, camera);
  const MAGNIFY = 1.4;
  const APART = 26; // px, least distance of the bodies along the path
  const NARROW = 560; // px, width of the chart below which its values stand above it
  const rows = plan.s.length;
  const robot = { colour: () => scene.colours.accent };
  let row = 0;
  let fitted = true;
  let queued = false;

  /* Name, unit, decimals and factor of each quantity of the plan. */
  const QUANTITIES = [
    ["s", "s", "m", 2], ["t", "t", "s", 2], ["speed", "speed", "m/s", 3], ["limit", "speed limit", "m/s", 3],
    ["clearance", "clearance", "m", 3], ["curvature", "curvature", "1/m", 3], ["cost", "cost", "", 2],
    ["yaw", "heading", "rad", 3], ["yawRate", "yaw rate", "rad/s", 3],
  ].filter(([column]) => plan[column] && plan[column].some(Number.isFinite));
  const TIP = QUANTITIES.filter(([column]) => !column.startsWith("yaw"));
  const SECOND = QUANTITIES.filter(([column]) => ["clearance", "curvature", "cost", "yawRate"].includes(column));

  scene.layers.outlines = true;
  const chart = new PlanChart(find("chart"), plan, hoverChart);

  const text = ([column, , unit, digits]) => {
    const value = plan[column][row];
    return Number.isFinite(value) ? `${value.toFixed(digits)} ${unit}`.trim() : "–";
  };

  function list(container, quantities) {
    container.replaceChildren();
    for (const quantity of quantities) {
      container.append(Object.assign(document.createElement("dt"), { textContent: quantity[1] }));
      container.append(Object.assign(document.createElement("dd"), { textContent: text(quantity) }));
    }
  }

  function refresh() {
    if (queued) return;
    queued = true;
    requestAnimationFrame(() => { queued = false; paint(); });
  }

  function paint() {
    scene.drawGround(true);
    if (scene.layers.outlines) drawOutlines();
    scene.drawRobot(robot, { x: plan.x[row], y: plan.y[row], yaw: plan.yaw[row] }, true);
    scene.drawScale();
  }

  /* The body along the path, at equal distances and at the end. */
  function drawOutlines() {
    const { ctx } = scene;
    const step = Math.max(APART / camera.scale, plan.s[rows - 1] / 60);
    ctx.strokeStyle = scene.colours.muted;
    ctx.lineWidth = 1;
    for (let k = 0, next = 0; k < rows; k++) {
      if (plan.s[k] < next && k < rows - 1) continue;
      next = plan.s[k] + step;
      ctx.save();
      ctx.translate(...camera.toScreen(plan.x[k], plan.y[k]));
      ctx.rotate(-plan.yaw[k]);
      ctx.beginPath();
      scene.traceBody();
      ctx.stroke();
      ctx.restore();
    }
  }

  /* Move the robot to a row, and show its values. */
  function go(next) {
    row = Math.min(Math.max(next, 0), rows - 1);
    find("at").value = row;
    find("at").setAttribute("aria-valuetext", QUANTITIES.map((each) => `${each[1]} ${text(each)}`).join(", "));
    find("clock").textContent = plan.s[row].toFixed(2);
    list(find("values"), QUANTITIES);
    chart.show(row);
    refresh();
  }

  /* Show the values beside a place of a box. */
  function showTip(tip, x, y, width, height) {
    tip.hidden = false;
    tip.replaceChildren(document.createElement("dl"));
    list(tip.firstChild, TIP);
    const left = x + 18 + tip.offsetWidth < width ? x + 18 : Math.max(x - 18 - tip.offsetWidth, 4);
    const above = -tip.offsetHeight - 4; // where the box is too narrow to show both
    const top = y === -Infinity ? above : Math.min(Math.max(y - 0.5 * tip.offsetHeight, 4), Math.max(height - tip.offsetHeight - 4, 4));
    tip.style.transform = `translate(${Math.round(left)}px, ${Math.round(top)}px)`;
  }

  function hoverChart(next, x, y) {
    const tip = find("chart-tip");
    tip.hidden = true;
    if (next === null) return;
    go(next);
    const box = tip.parentElement;
    const host = find("chart");
    const narrow = box.clientWidth < NARROW;
    showTip(tip, x + host.offsetLeft, narrow ? -Infinity : y + host.offsetTop, box.clientWidth, box.clientHeight);
  }

  /* Move the robot to the point of the path that is nearest to the pointer. */
  function hoverMap(event) {
    if (event.buttons && event.pointerType === "mouse") return;
    const [px, py] = camera.position(event);
    const [x, y] = camera.toWorld(px, py);
    let best = 0;
    let least = Infinity;
    for (let k = 0; k < rows; k++) {
      const away = (plan.x[k] - x) ** 2 + (plan.y[k] - y) ** 2;
      if (away < least) [least, best] = [away, k];
    }
    go(best);
    showTip(find("map-tip"), px, py, camera.width, camera.height);
  }

  function fit() {
    fitted = true;
    const size = Study.robot.bodyRadius;
    const ends = (column) => [column.reduce((a, b) => Math.min(a, b)) - size, column.reduce((a, b) => Math.max(a, b)) + size];
    const [left, right] = ends(plan.x);
    const [bottom, top] = ends(plan.y);
    const { map } = Study;
    const large = Math.max((right - left) / (map.right - map.left), (top - bottom) / (map.top - map.bottom)) > 0.4;
    camera.fit(large ? map : { left, right, bottom, top }, large ? 0.02 : 0.2);
  }

  function zoom(factor) {
    fitted = false;
    camera.zoom(factor);
  }

  const KEYS = {
    ArrowLeft: () => go(row - 1), ArrowRight: () => go(row + 1), Home: () => go(0), End: () => go(rows - 1),
    PageDown: () => go(row - 50), PageUp: () => go(row + 50),
    "+": () => zoom(MAGNIFY), "=": () => zoom(MAGNIFY), "-": () => zoom(1 / MAGNIFY), f: fit,
  };
  const PANS = { ArrowLeft: [60, 0], ArrowRight: [-60, 0], ArrowUp: [0, 60], ArrowDown: [0, -60] };

  function press(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const pan = event.shiftKey && PANS[event.key];
    if (!pan && !KEYS[event.key]) return;
    event.preventDefault();
    event.stopPropagation(); // the player has the same keys
    if (pan) camera.onDrag();
    if (pan) camera.pan(...pan);
    else KEYS[event.key]();
  }

  function selectSecond() {
    const found = SECOND.find(([column]) => column === find("second").value);
    find("second-key").hidden = !found;
    if (found) find("second-name").textContent = found[2] ? `${found[1]} in ${found[2]}` : found[1];
    chart.build(found ? { column: found[0] } : null);
  }

  function wire() {
    canvas.addEventListener("pointermove", hoverMap);
    canvas.addEventListener("pointerdown", hoverMap);
    canvas.addEventListener("pointerleave", () => { find("map-tip").hidden = true; });
    canvas.addEventListener("wheel", () => { fitted = false; }, { passive: true });
    canvas.addEventListener("keydown", press);
    camera.onMove = refresh;
    camera.onDrag = () => { fitted = false; };
    find("at").addEventListener("input", (event) => go(Number(event.target.value)));
    find("in").addEventListener("click", () => zoom(MAGNIFY));
    find("out").addEventListener("click", () => zoom(1 / MAGNIFY));
    find("fit").addEventListener("click", fit);
    find("second").addEventListener("change", selectSecond);
    for (const name of ["costs", "zones", "outlines", "cells", "inflated"]) {
      find(`layer-${name}`).addEventListener("change", (event) => {
        scene.layers[name] = event.target.checked;
        scene.recolour();
        refresh();
      });
    }
    Theme.onChange(() => {
      scene.recolour();
      chart.redraw();
      paint(); // now: the browser prints before the next frame
    });
    MapLayers.onReady(refresh);
    new ResizeObserver(() => {
      scene.resize();
      if (fitted) fit();
      refresh();
    }).observe(canvas);
  }

  MapLayers.hideAbsent("plan-");
  const shows = (kind) => Study.map.kinds.includes(kind);
  find("obstacle-key").hidden = !shows(2);
  for (const id of ["inflated-layer", "inflated-key"]) find(id).hidden = !shows(1);
  for (const id of ["cells-layer", "cells-key"]) find(id).hidden = !Study.cells[0].length;
  find("at").max = rows - 1;
  find("length").textContent = plan.s[rows - 1].toFixed(2);
  find("second").append(new Option("none", ""), ...SECOND.map(([column, name]) => new Option(name, column)));
  find("second").value = SECOND.length ? SECOND[0][0] : "";
  wire();
  scene.resize();
  fit();
  selectSecond();
  go(Math.round(0.25 * (rows - 1)));
  return { row: () => row, go, camera, layers: scene.layers };
})();
