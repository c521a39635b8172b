"use strict";
/* Decoded data of the study, with interpolation in time. Lengths in m, angles in rad, times in s. */
const Study = (() => {
  const raw = JSON.parse(document.getElementById("study").textContent);
  const numbers = (column) => Float64Array.from(column, (v) => (v === null ? NaN : v));
  const wrap = (angle) => angle - 2 * Math.PI * Math.floor((angle + Math.PI) / (2 * Math.PI));

  /* Three significant digits, two below 0.001, and 0 below the resolution of tables, 1e-6. */
  function text(value) {
    if (!Number.isFinite(value)) return "–";
    if (Math.abs(value) < 1e-6) return "0";
    const exponent = Math.floor(Math.log10(Math.abs(value)));
    if (exponent < -3) return value.toExponential(1);
    return value.toFixed(Math.max(2 - exponent, 0));
  }

  /* Value of a column at a fractional row, interpolated linearly; constant after the last row. */
  function sample(column, row) {
    const last = column.length - 1;
    if (row >= last) return column[last];
    const k = Math.floor(row);
    return column[k] + (row - k) * (column[k + 1] - column[k]);
  }

  function decodeRun(run, target) {
    const [x, y, yaw] = run.pose.map(numbers);
    const rows = x.length;
    const distance = new Float64Array(rows);
    const turn = new Float64Array(rows);
    for (let k = 0; k < rows; k++) {
      distance[k] = Math.hypot(x[k] - target.x[k], y[k] - target.y[k]);
      turn[k] = wrap(yaw[k] - target.yaw[k]);
    }
    const tuning = Object.fromEntries(Object.entries(run.tuning).map(([name, column]) => [name, numbers(column)]));
    return {
      label: run.label, short: run.short, ink: run.ink, dash: run.dash, ended: run.ended, rows, visible: true,
      x, y, yaw, distance, turn, speed: numbers(run.speed), yawRate: numbers(run.yawRate),
      measured: run.measured && run.measured.map(numbers),
      tuning,
      /* Column by name; undefined if it does not exist. */
      column(name) { return this[name] ?? tuning[name]; },
      /* Value at a fractional row; gains and their inputs hold until the next row. */
      value(name, row) {
        if (this[name]) return sample(this[name], row);
        return tuning[name]?.[Math.floor(row + 1e-6)] ?? NaN;
      },
      colour() { return this.ink[Theme.dark() ? 1 : 0]; },
      at(row) {
        const value = (name) => sample(this[name], row);
        return {
          x: value("x"), y: value("y"), yaw: value("yaw"), distance: value("distance"),
          turn: value("turn"), speed: value("speed"), yawRate: value("yawRate"),
          stopped: this.ended !== null && row >= this.rows - 1,
        };
      },
    };
  }

  function decodeGroup(group) {
    const [x, y, yaw] = group.target.map(numbers);
    const target = { x, y, yaw, at: (row) => ({ x: sample(x, row), y: sample(y, row), yaw: sample(yaw, row) }) };
    const t = numbers(group.t);
    return {
      id: group.id, label: group.label, onMap: group.onMap, tuning: group.tuning, t, target, duration: t[t.length - 1],
      runs: group.runs.map((run) => decodeRun(run, target)),
    };
  }

  function decodeMap(map) {
    const kinds = new Uint8Array(map.rows * map.cols);
    for (let i = 0, cell = 0; i < map.kinds.length; i += 2) {
      kinds.fill(map.kinds[i], cell, (cell += map.kinds[i + 1]));
    }
    const [x, y, yaw] = map.origin;
    const [left, right, bottom, top] = map.extent;
    return { rows: map.rows, cols: map.cols, resolution: map.resolution, size: map.size, kinds, x, y, yaw, left, right, bottom, top };
  }

  const decodePlan = (plan) => plan && Object.fromEntries(Object.entries(plan).map(([name, column]) => [name, numbers(column)]));

  return {
    dt: raw.dt, robot: raw.robot, map: decodeMap(raw.map), wrap, text,
    cells: raw.cells.map(numbers), spline: raw.spline.map(numbers),
    plan: decodePlan(raw.plan), layers: raw.layers,
    groups: raw.groups.map(decodeGroup),
  };
})();
