"use strict";
/* Time-series charts with a common time axis, cursor and playback time. Gains of self-tuning controllers have separate
   charts, for one channel at a time. */
const Charts = (() => {
  const MM = 1e3;
  const KINDS = [
    { column: "distance", title: "Position error", unit: "mm", factor: MM, fromZero: true, error: true },
    { column: "turn", title: "Heading error", unit: "mrad", factor: 1e3, fromZero: false, error: true },
    { column: "speed", title: "Speed", unit: "m/s", factor: 1, digits: 3, fromZero: true },
    { column: "yawRate", title: "Yaw rate", unit: "rad/s", factor: 1, digits: 3, fromZero: false },
  ];
  const DIGITS = 3; // of gains and their inputs
  const FONT = "11px system-ui, sans-serif";
  const host = document.getElementById("charts");
  const tuningPart = document.getElementById("tuning");
  const tuningHost = document.getElementById("tuning-charts");
  const channel = document.getElementById("tuning-channel");
  const rangeText = document.getElementById("chart-range");
  const logBox = document.getElementById("chart-log");
  const DECADES = 5; // at most, of a log scale
  const HELD = uPlot.paths.stepped({ align: 1 }); // a gain is constant until the next sample
  const panels = [];
  let group = null;
  let time = 0;
  let seek = () => {};
  let zooming = false;
  let span = [0, 1];

  const element = (tag, name, parent) => {
    const made = document.createElement(tag);
    made.className = name;
    parent.append(made);
    return made;
  };

  const isLog = (kind) => Boolean(kind.error) && logBox.checked;

  /* Values in the unit of the chart; on a log scale absolute ones, without zeros. */
  function columns(kind) {
    const rows = group.t.length;
    const shown = isLog(kind) ? (value) => Math.abs(value) || null : (value) => value;
    const series = group.runs.map((run) => {
      const column = run.column(kind.column);
      return Array.from({ length: rows }, (_, k) => (column && Number.isFinite(column[k]) ? shown(column[k] * kind.factor) : null));
    });
    return [Array.from(group.t), ...series];
  }

  function axis(size, values) {
    return {
      size, values, font: FONT, gap: 4,
      stroke: () => Theme.colour("muted"),
      grid: { stroke: () => Theme.colour("grid"), width: 1 },
      ticks: { stroke: () => Theme.colour("grid"), width: 1, size: 5 },
    };
  }

  /* Ticks of a log scale: powers of ten, with 2 and 5 between them if they are few. */
  function powers(chart, index, low, high) {
    const digits = high > 100 * low ? [1] : [1, 2, 5];
    const ticks = [];
    for (let power = Math.floor(Math.log10(low)); power <= Math.log10(high); power++) {
      for (const digit of digits) ticks.push(digit * 10 ** power);
    }
    return ticks.filter((tick) => tick >= low && tick <= high);
  }

  function options(panel, width) {
    const { kind } = panel;
    const range = (_, low, high) => {
      if (low === null || high === null) return isLog(kind) ? [0.1, 1] : [0, 1];
      if (isLog(kind)) return [Math.max(0.8 * low, high / 10 ** DECADES), 1.25 * high];
      if (kind.fromZero) return [0, high > 0 ? 1.08 * high : 1];
      const pad = 0.08 * (high - low) || 0.5;
      return [low - pad, high + pad];
    };
    return {
      width, height: 190, legend: { show: false },
      cursor: { sync: { key: "playback" }, drag: { x: true, y: false, dist: 4 }, points: { size: 7 } },
      scales: { x: { time: false }, y: { range, distr: isLog(kind) ? 3 : 1 } },
      axes: [axis(30, (_, ticks) => ticks.map((t) => `${+t.toPrecision(6)} s`)), { ...axis(52), ...(isLog(kind) ? { splits: powers } : {}) }],
      series: [{}, ...group.runs.map((run) => ({ label: run.label, show: run.visible, stroke: run.colour(), width: 1.6, dash: run.dash.map((length) => 2 * length), spanGaps: false, paths: kind.held ? HELD : undefined }))],
      hooks: {
        ready: [(chart) => attach(panel, chart)],
        setCursor: [(chart) => show(panel, chart.cursor.idx)],
        setScale: [(chart, key) => key === "x" && shareRange(chart)],
        draw: [() => placeMark(panel)],
      },
    };
  }

  /* Marker of the playback time, which a click sets. */
  function attach(panel, chart) {
    panel.mark = element("div", "time-mark", chart.over);
    let pressed = 0;
    chart.over.addEventListener("mousedown", (event) => { pressed = event.clientX; });
    chart.over.addEventListener("click", (event) => {
      if (Math.abs(event.clientX - pressed) > 3) return;
      const t = chart.posToVal(event.clientX - chart.over.getBoundingClientRect().left, "x");
      seek(Math.min(Math.max(t, 0), group.duration));
    });
    chart.over.addEventListener("mouseleave", () => panels.forEach((other) => show(other, null)));
  }

  function placeMark(panel) {
    if (!panel.chart || !panel.mark) return;
    const x = panel.chart.valToPos(time, "x");
    const inside = x >= -1 && x <= panel.chart.over.clientWidth + 1;
    panel.mark.hidden = !inside;
    panel.mark.style.transform = `translateX(${x}px)`;
  }

  /* Show the values at the cursor, or else at the playback time. */
  function show(panel, row) {
    const { kind } = panel;
    const hovering = row !== null && row !== undefined;
    const at = hovering ? row : time / Study.dt;
    panel.clock.textContent = `t = ${(hovering ? group.t[row] : time).toFixed(2)} s`;
    panel.clock.classList.toggle("hovering", hovering);
    group.runs.forEach((run, k) => {
      const signed = hovering && row >= run.rows ? NaN : run.value(kind.column, at);
      const value = isLog(kind) ? Math.abs(signed) : signed;
      panel.values[k].textContent = kind.error ? Study.text(value * kind.factor) : Number.isFinite(value) ? (value * kind.factor).toFixed(kind.digits) : "–";
      panel.items[k].hidden = !run.visible || !run.column(kind.column);
    });
  }

  /* Copy the time range of one chart to all others. */
  function shareRange(chart) {
    if (zooming) return;
    const { min, max } = chart.scales.x;
    if (!Number.isFinite(min) || !Number.isFinite(max)) return;
    span = [min, max];
    zooming = true;
    for (const { chart: other } of panels) if (other && other !== chart) other.setScale("x", { min, max });
    zooming = false;
    rangeText.textContent = `${min.toFixed(2)} s to ${max.toFixed(2)} s`;
  }

  function build(kind, container) {
    const root = element("figure", "chart", container);
    const head = element("figcaption", "chart-head", root);
    const title = isLog(kind) && !kind.fromZero ? `${kind.title}, absolute` : kind.title;
    element("strong", "", head).textContent = kind.unit ? `${title} in ${kind.unit}` : `${title}, no unit`;
    const panel = { kind, root, container, items: [], values: [], clock: element("span", "clock", head), chart: null };
    const list = element("div", "chart-values", root);
    for (const run of group.runs) {
      const item = element("span", "value", list);
      item.title = run.label;
      element("i", "swatch", item).style.background = run.colour();
      item.append(`${run.short} `);
      panel.items.push(item);
      panel.values.push(element("b", "", item));
    }
    panel.chart = new uPlot(options(panel, Math.max(root.clientWidth, 200)), columns(kind), root);
    panels.push(panel);
    show(panel, null);
  }

  function load(next) {
    clear(host);
    group = next;
    KINDS.forEach((kind) => build(kind, host));
    listChannels();
    buildTuning();
    zoomTo(0, group.duration);
  }

  /* Remove the charts of one container. */
  function clear(container) {
    const removed = panels.filter((panel) => panel.container === container);
    panels.splice(0, panels.length, ...panels.filter((panel) => panel.container !== container));
    for (const panel of removed) {
      panel.chart.destroy();
      panel.root.remove();
    }
  }

  /* List the channels of the group; keep the selected one if it exists. */
  function listChannels() {
    const names = [...new Set(group.tuning.map((each) => each.channel))];
    const selected = names.includes(channel.value) ? channel.value : names[0];
    channel.replaceChildren(...names.map((name) => new Option(name, name, false, name === selected)));
    tuningPart.hidden = names.length === 0;
  }

  function buildTuning() {
    clear(tuningHost);
    for (const each of group.tuning.filter((one) => one.channel === channel.value)) {
      const column = `${each.quantity} ${each.channel}`;
      build({ column, title: each.title, unit: each.unit, factor: 1, digits: DIGITS, fromZero: false, held: true }, tuningHost);
    }
  }

  logBox.addEventListener("change", () => {
    const [min, max] = span;
    load(group);
    zoomTo(min, max);
  });

  channel.addEventListener("change", () => {
    const [min, max] = span;
    buildTuning();
    zooming = true;
    for (const { chart, container } of panels) if (container === tuningHost) chart.setScale("x", { min, max });
    zooming = false;
  });

  function zoomTo(min, max) {
    if (panels.length) panels[0].chart.setScale("x", { min: Math.max(min, 0), max: Math.min(max, group.duration) });
  }

  /* Zoom the time axis about the playback time. */
  function zoom(factor) {
    const length = Math.min(Math.max((span[1] - span[0]) * factor, 4 * Study.dt), group.duration);
    const middle = Math.min(Math.max(time, 0.5 * length), group.duration - 0.5 * length);
    zoomTo(middle - 0.5 * length, middle + 0.5 * length);
  }

  const resized = new ResizeObserver(() => {
    for (const { chart, root } of panels) {
      if (root.clientWidth && root.clientWidth !== chart.width) chart.setSize({ width: root.clientWidth, height: 190 });
    }
  });
  for (const container of [host, tuningHost]) resized.observe(container);

  return {
    load,
    zoom,
    fit: () => zoomTo(0, group.duration),
    span: () => span,
    show: zoomTo,
    onSeek(listener) { seek = listener; },
    tick(t) {
      time = t;
      for (const panel of panels) {
        placeMark(panel);
        if (!Number.isInteger(panel.chart.cursor.idx)) show(panel, null);
      }
    },
    toggle(k, visible) {
      for (const panel of panels) {
        panel.chart.setSeries(k + 1, { show: visible });
        show(panel, null);
      }
    },
  };
})();
