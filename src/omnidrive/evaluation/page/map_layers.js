"use strict";
/* Costs, keep-out zones, speed zones and lanes on the map, decoded from an image whose channels are cost, speed limit and region. */
const MapLayers = (() => {
  const KEPT_OUT = 255;
  const DIRECTIONS = 254;
  const { layers } = Study;
  const listeners = [];
  let pixels = null; // RGBA, top row first
  let rows = 0;
  let cols = 0;

  const shows = {
    costs: Boolean(layers && layers.topCost > 0),
    zones: Boolean(layers && (layers.topSpeed > 0 || layers.keptOut || layers.lanes)),
  };

  async function decode() {
    const image = new Image();
    image.src = `data:image/png;base64,${layers.png}`;
    await image.decode();
    [rows, cols] = [image.naturalHeight, image.naturalWidth];
    const ctx = new OffscreenCanvas(cols, rows).getContext("2d", { willReadFrequently: true });
    ctx.drawImage(image, 0, 0);
    pixels = ctx.getImageData(0, 0, cols, rows).data;
    for (const listener of listeners) listener();
  }

  /* Fill a picture with one pixel per cell; the colour function gets the index of a cell and returns r, g, b, opacity from 0 to 1. */
  function paint(colour) {
    const picture = new OffscreenCanvas(cols, rows);
    const ctx = picture.getContext("2d");
    const image = ctx.createImageData(cols, rows);
    for (let k = 0; k < rows * cols; k++) {
      const found = colour(k);
      if (found) image.data.set([found[0], found[1], found[2], Math.round(255 * found[3])], 4 * k);
    }
    ctx.putImageData(image, 0, 0);
    return picture;
  }

  const parts = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));

  function paintCosts() {
    const ramp = ["cost-low", "cost-middle", "cost-high"].map((name) => parts(Theme.colour(name)));
    return paint((k) => {
      const share = pixels[4 * k] / 255;
      if (share === 0) return null;
      const [a, b] = share < 0.5 ? ramp : ramp.slice(1);
      const mix = share < 0.5 ? 2 * share : 2 * share - 1;
      return [...a.map((value, i) => Math.round(value + mix * (b[i] - value))), 0.06 + 0.44 * share];
    });
  }

  /* Keep-out zones are hatched, speed zones tinted: the more, the lower the limit. The border of a zone is opaque. */
  function paintZones() {
    const [speed, kept] = ["speed-zone", "keep-out"].map((name) => parts(Theme.colour(name)));
    const differs = (k, channel) => {
      const own = pixels[4 * k + channel];
      const col = k % cols;
      const other = (at) => channel === 2 ? (pixels[4 * at + 2] === KEPT_OUT) !== (own === KEPT_OUT) : pixels[4 * at + 1] !== own;
      return (col > 0 && other(k - 1)) || (col < cols - 1 && other(k + 1)) || (k >= cols && other(k - cols)) || (k + cols < rows * cols && other(k + cols));
    };
    return paint((k) => {
      if (pixels[4 * k + 2] === KEPT_OUT) {
        const hatched = (Math.floor(k / cols) + (k % cols)) % 6 < 2;
        return [...kept, differs(k, 2) ? 0.95 : hatched ? 0.75 : 0.25];
      }
      const limit = pixels[4 * k + 1] / 255;
      return limit > 0 ? [...speed, differs(k, 1) ? 0.8 : 0.32 - 0.2 * limit] : null;
    });
  }

  /* Direction of the lane at a point (x, y) of the world, rad; NaN where there is none. */
  function lane(x, y) {
    const { x: left, y: bottom, yaw } = Study.map;
    const [dx, dy] = [x - left, y - bottom];
    const col = Math.floor((dx * Math.cos(yaw) + dy * Math.sin(yaw)) / layers.cell);
    const row = Math.floor((dy * Math.cos(yaw) - dx * Math.sin(yaw)) / layers.cell);
    if (col < 0 || row < 0 || col >= cols || row >= rows) return NaN;
    const code = pixels[4 * ((rows - 1 - row) * cols + col) + 2];
    return code === 0 || code === KEPT_OUT ? NaN : ((code - 1) / DIRECTIONS) * 2 * Math.PI;
  }

  if (layers) decode();
  return {
    shows, lane,
    ready: () => pixels !== null,
    /* Pictures of the layers in the colours of the theme. */
    pictures: () => ({ costs: shows.costs && paintCosts(), zones: shows.zones && paintZones() }),
    size: () => [cols * layers.cell, rows * layers.cell],
    onReady(listener) { listeners.push(listener); },
    /* Hide the controls and keys of layers that the map does not have; the ids start with the prefix. */
    hideAbsent(prefix) {
      const parts = {
        "costs-layer": shows.costs, "costs-key": shows.costs, "zones-layer": shows.zones,
        "speed-key": Boolean(layers && layers.topSpeed > 0),
        "keep-out-key": Boolean(layers && layers.keptOut), "lane-key": Boolean(layers && layers.lanes),
      };
      for (const [id, shown] of Object.entries(parts)) document.getElementById(prefix + id).hidden = !shown;
      if (!layers) return;
      const { lowSpeed: low, topSpeed: top, topCost } = layers;
      document.getElementById(`${prefix}costs-text`).textContent = `cost 0 to ${+topCost.toPrecision(3)}`;
      const span = low < top ? `${+low.toPrecision(3)} to ${+top.toPrecision(3)}` : +top.toPrecision(3);
      document.getElementById(`${prefix}speed-text`).textContent = `speed zone, ${span} m/s`;
    },
  };
})();
