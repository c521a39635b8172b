"use strict";
/* Playback of the runs: time, controls and displayed values. */
const Playback = (() => {
  const find = (id) => document.getElementById(id);
  const canvas = find("map");
  const tip = find("tip");
  const camera = new Camera(canvas);
  const scene = new Scene(canvas, camera);
  const lens = new Lens(find("lens"));
  const MAGNIFY = 1.4;
  const OPENING = 0.25; // share of the duration at which a group opens
  const MAX_FRAME = 0.1; // s; longest time step, for example after the page was hidden

  let group = null;
  let time = 0;
  let playing = false;
  let lastStamp = null; // time stamp of the last frame while playing, ms
  let queued = false;
  let followed = null;
  let pointer = null; // px, position of the pointer
  let fitted = true; // whether the camera fits everything, also after a resize
  let readouts = [];

  const row = () => time / Study.dt;
  const element = (tag, name, parent) => {
    const made = document.createElement(tag);
    if (name) made.className = name;
    parent.append(made);
    return made;
  };

  function refresh() {
    if (queued) return;
    queued = true;
    requestAnimationFrame(frame);
  }

  function frame(stamp) {
    queued = false;
    if (playing) {
      if (lastStamp !== null) time += Math.min((stamp - lastStamp) / 1000, MAX_FRAME) * Number(find("speed").value);
      lastStamp = stamp;
      if (time >= group.duration) {
        time = group.duration;
        pause();
      }
    }
    paint();
    if (playing) refresh();
  }

  function paint() {
    if (followed) {
      const { x, y } = followed.at(row());
      if (Number.isFinite(x) && Number.isFinite(y)) [camera.x, camera.y] = [x, y];
    }
    const hovered = pointer && nearest();
    scene.draw(group, row(), hovered && hovered.run);
    if (hovered) scene.drawLeader(pointer, hovered.state);
    lens.draw(group, row());
    showTip(hovered);
    find("scrub").value = time;
    find("scrub").setAttribute("aria-valuetext", `${time.toFixed(2)} seconds`);
    find("clock").textContent = time.toFixed(2);
    for (const { run, cells } of readouts) readout(cells, run.at(row()));
    Charts.tick(time);
  }

  function readout(cells, state) {
    const values = [1e3 * state.distance, 1e3 * state.turn, state.speed];
    cells.forEach((cell, k) => {
      cell.textContent = Study.text(values[k]);
      cell.classList.toggle("stopped", state.stopped);
    });
  }

  /* Visible robot whose centre is closest to the pointer. */
  function nearest() {
    let best = null;
    for (const run of group.runs) {
      if (!run.visible) continue;
      const state = run.at(row());
      const [px, py] = camera.toScreen(state.x, state.y);
      const distance = Math.hypot(px - pointer[0], py - pointer[1]);
      if (Number.isFinite(distance) && (best === null || distance < best.distance)) best = { run, state, distance };
    }
    return best;
  }

  function showTip(hovered) {
    tip.hidden = !hovered;
    if (!hovered) return;
    const { run, state } = hovered;
    tip.replaceChildren();
    const head = element("strong", "", tip);
    element("i", "swatch", head).style.background = run.colour();
    head.append(run.label);
    const list = element("dl", "", tip);
    const values = {
      t: `${time.toFixed(2)} s`,
      x: `${state.x.toFixed(4)} m`,
      y: `${state.y.toFixed(4)} m`,
      heading: `${state.yaw.toFixed(4)} rad`,
      "position error": `${Study.text(1e3 * state.distance)} mm`,
      "heading error": `${Study.text(1e3 * state.turn)} mrad`,
      speed: `${state.speed.toFixed(3)} m/s`,
    };
    if (state.stopped) values.ended = run.ended;
    for (const [name, value] of Object.entries(values)) {
      element("dt", "", list).textContent = name;
      element("dd", "", list).textContent = value;
    }
    const [x, y] = pointer;
    const left = x + 18 + tip.offsetWidth < camera.width ? x + 18 : Math.max(x - 18 - tip.offsetWidth, 4);
    const top = Math.min(Math.max(y - 0.5 * tip.offsetHeight, 4), Math.max(camera.height - tip.offsetHeight - 4, 4));
    tip.style.transform = `translate(${Math.round(left)}px, ${Math.round(top)}px)`;
  }

  function seek(t) {
    time = Math.min(Math.max(t, 0), group.duration);
    refresh();
  }

  /* Step by whole samples from the nearest one. */
  function step(samples) {
    pause();
    seek((Math.round(row()) + samples) * Study.dt);
  }

  function play() {
    if (time >= group.duration) time = 0;
    playing = true;
    lastStamp = null;
    describePlay();
    refresh();
  }

  function pause() {
    playing = false;
    describePlay();
  }

  function describePlay() {
    find("play").setAttribute("aria-label", playing ? "Pause" : "Play");
    find("play").classList.toggle("playing", playing);
  }

  const toggle = () => (playing ? pause() : play());

  function follow(k) {
    followed = k < 0 ? null : group.runs[k];
    camera.locked = followed !== null;
    find("follow").value = String(k);
    if (followed) {
      fitted = false;
      const close = (0.28 * Math.min(camera.width, camera.height)) / Study.robot.bodyRadius;
      camera.scale = Math.max(camera.scale, close);
    }
    refresh();
  }

  function fit() {
    follow(-1);
    fitted = true;
    const box = extent();
    if (group.onMap && fillsMap(box)) camera.fit(Study.map, 0.02);
    else camera.fit(box, group.onMap ? 0.2 : 0.08);
  }

  /* Whether a box covers most of the map, so that the whole map is shown. */
  function fillsMap(box) {
    const { left, right, bottom, top } = Study.map;
    const ratio = Math.max((box.right - box.left) / (right - left), (box.top - box.bottom) / (top - bottom));
    return ratio > 0.6;
  }

  /* Bounding box of all robots during the runs. */
  function extent() {
    const size = Study.robot.bodyRadius;
    const ends = (name) => {
      const all = [group.target, ...group.runs].flatMap((run) => Array.from(run[name]).filter(Number.isFinite));
      return [all.reduce((a, b) => Math.min(a, b)) - size, all.reduce((a, b) => Math.max(a, b)) + size];
    };
    const [left, right] = ends("x");
    const [bottom, top] = ends("y");
    return { left, right, bottom, top };
  }

  function zoom(factor) {
    fitted = false;
    camera.zoom(factor);
  }

  /* Show a group from a time at which the robots move; a running playback goes on. */
  function choose(next) {
    group = next;
    time = Math.round((OPENING * group.duration) / Study.dt) * Study.dt;
    lastStamp = null;
    pointer = null;
    find("scrub").max = group.duration;
    find("scrub").step = Study.dt;
    find("duration").textContent = group.duration.toFixed(2);
    for (const id of ["cells-layer", "cells-key"]) find(id).hidden = !Study.cells[0].length;
    const shows = (kind) => group.onMap && Study.map.kinds.includes(kind);
    find("obstacle-key").hidden = !shows(2);
    for (const id of ["inflated-layer", "inflated-key"]) find(id).hidden = !shows(1);
    find("measured-layer").hidden = !group.runs.some((run) => run.measured);
    listRuns();
    Charts.load(group);
    fit();
    refresh();
  }

  /* Fill the table of controllers and the list of robots to follow. */
  function listRuns() {
    const body = find("runs");
    body.replaceChildren();
    find("follow").replaceChildren(new Option("none", "-1"));
    readouts = group.runs.map((run, k) => {
      find("follow").append(new Option(run.label, String(k)));
      const line = element("tr", "", body);
      const head = element("th", "", line);
      head.scope = "row";
      const name = element("label", "", head);
      const box = element("input", "", name);
      box.type = "checkbox";
      box.checked = run.visible;
      box.addEventListener("change", () => {
        run.visible = box.checked;
        Charts.toggle(k, run.visible);
        refresh();
      });
      element("i", "swatch", name).style.background = run.colour();
      element("span", "", name).textContent = run.label;
      if (run.ended !== null) element("small", "ended", head).textContent = run.ended;
      return { run, cells: [0, 1, 2].map(() => element("td", "", line)) };
    });
  }

  /* Colour the swatches beside names outside the playback. */
  function colourNames() {
    const runs = Study.groups.flatMap((each) => each.runs);
    for (const swatch of document.querySelectorAll("[data-controller]")) {
      const run = runs.find((each) => each.short === swatch.dataset.controller);
      if (run) swatch.style.background = run.colour();
    }
  }

  function listGroups() {
    const list = find("groups");
    Study.groups.forEach((each, k) => {
      const choice = element("label", "pill", list);
      const radio = element("input", "", choice);
      radio.type = "radio";
      radio.name = "group";
      radio.checked = k === 0;
      radio.addEventListener("change", () => choose(each));
      element("span", "", choice).textContent = each.label;
    });
  }

  function wireControls() {
    const clicks = {
      play: toggle,
      start: () => { pause(); seek(0); },
      back: () => step(-1),
      forward: () => step(1),
      "zoom-in": () => zoom(MAGNIFY),
      "zoom-out": () => zoom(1 / MAGNIFY),
      fit,
      theme: () => Theme.toggle(),
      "chart-in": () => Charts.zoom(0.5),
      "chart-out": () => Charts.zoom(2),
      "chart-fit": () => Charts.fit(),
    };
    for (const [id, action] of Object.entries(clicks)) find(id).addEventListener("click", action);
    find("scrub").addEventListener("input", (event) => { pause(); seek(Number(event.target.value)); });
    find("follow").addEventListener("change", (event) => follow(Number(event.target.value)));
    for (const name of Object.keys(scene.layers)) {
      find(`layer-${name}`).addEventListener("change", (event) => {
        scene.layers[name] = event.target.checked;
        scene.recolour();
        refresh();
      });
    }
  }

  function wirePointer() {
    const point = (event) => {
      pointer = camera.position(event);
      refresh();
    };
    canvas.addEventListener("pointermove", point);
    canvas.addEventListener("pointerdown", point);
    canvas.addEventListener("pointerleave", (event) => {
      if (event.pointerType !== "mouse") return; // after a tap, the values stay
      pointer = null;
      refresh();
    });
    camera.onMove = refresh;
    camera.onDrag = () => {
      fitted = false;
      if (followed) follow(-1);
    };
    canvas.addEventListener("wheel", () => { fitted = false; }, { passive: true });
  }

  const KEYS = {
    " ": toggle,
    k: toggle,
    ArrowLeft: () => step(-1),
    ArrowRight: () => step(1),
    Home: () => { pause(); seek(0); },
    End: () => { pause(); seek(group.duration); },
    "+": () => zoom(MAGNIFY),
    "=": () => zoom(MAGNIFY),
    "-": () => zoom(1 / MAGNIFY),
    f: fit,
  };
  const PANS = { ArrowLeft: [60, 0], ArrowRight: [-60, 0], ArrowUp: [0, 60], ArrowDown: [0, -60] };

  function press(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const onMap = event.target === canvas;
    const scrubbing = event.target.id === "scrub" && event.key === " ";
    if (!onMap && !scrubbing && event.target.closest("input, select, button, summary, a, .scroll")) return;
    if (onMap && event.shiftKey && PANS[event.key]) {
      event.preventDefault();
      camera.onDrag();
      camera.pan(...PANS[event.key]);
      return;
    }
    const action = KEYS[event.key];
    if (!action || (!onMap && (event.key === "Home" || event.key === "End"))) return;
    event.preventDefault();
    action();
  }

  function begin() {
    listGroups();
    wireControls();
    wirePointer();
    document.addEventListener("keydown", press);
    Charts.onSeek((t) => { pause(); seek(t); });
    Theme.onChange(() => {
      scene.recolour();
      lens.scene.recolour();
      colourNames();
      const [min, max] = Charts.span();
      listRuns();
      Charts.load(group);
      Charts.show(min, max);
      refresh();
    });
    MapLayers.hideAbsent("");
    MapLayers.onReady(refresh);
    scene.resize();
    lens.scene.resize();
    choose(Study.groups[0]);
    colourNames();
    if (!matchMedia("(prefers-reduced-motion: reduce)").matches) play();
    for (const [event, printing] of [["beforeprint", true], ["afterprint", false]]) {
      addEventListener(event, () => {
        Theme.print(printing);
        paint(); // now: the browser prints before the next frame
      });
    }
    new ResizeObserver(() => {
      scene.resize();
      lens.scene.resize();
      if (fitted) fit();
      refresh();
    }).observe(canvas);
  }

  if (Study.groups.length) begin();
  else {
    for (const part of document.querySelectorAll(".playback")) part.hidden = true;
    find("theme").addEventListener("click", () => Theme.toggle());
  }
  return { time: () => time, playing: () => playing, camera };
})();
