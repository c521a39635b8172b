"use strict";
/* Speed, speed limit and one other quantity of the planned motion over the arc length, with a mark at one point of it. */
class PlanChart {
  static FONT = "11px system-ui, sans-serif";
  static HEIGHT = 170;

  /* Calls onHover with the row under the pointer and its place on the page, or null when the pointer leaves. */
  constructor(host, plan, onHover) {
    this.host = host;
    this.plan = plan;
    this.onHover = onHover;
    this.row = 0;
    this.build(null);
    new ResizeObserver(() => {
      const width = host.clientWidth;
      if (width && width !== this.chart.width) this.chart.setSize({ width, height: PlanChart.HEIGHT });
    }).observe(host);
  }

  /* Show another quantity on the right axis: { column, unit }, or null. */
  build(second) {
    if (this.chart) this.chart.destroy();
    const finite = (column) => Array.from(column, (value) => (Number.isFinite(value) ? value : null));
    const { s, speed, limit } = this.plan;
    const data = [Array.from(s), finite(speed), finite(limit)];
    if (second) data.push(finite(this.plan[second.column]));
    this.chart = new uPlot(this.options(second), data, this.host);
    this.mark = document.createElement("div");
    this.mark.className = "time-mark";
    this.chart.over.append(this.mark);
    this.chart.over.addEventListener("mouseleave", () => this.onHover(null));
    this.show(this.row);
  }

  options(second) {
    const colour = (name) => () => Theme.colour(name);
    const axis = (more) => ({
      font: PlanChart.FONT, gap: 4, stroke: colour("muted"),
      grid: { stroke: colour("grid"), width: 1 }, ticks: { stroke: colour("grid"), width: 1, size: 5 }, ...more,
    });
    const line = (name, more) => ({ stroke: colour(name), width: 1.8, spanGaps: false, points: { show: false }, ...more });
    const fromZero = (_, low, high) => [0, high > 0 ? 1.08 * high : 1];
    const padded = (_, low, high) => {
      if (low === null || high === null) return [0, 1];
      const pad = 0.08 * (high - low) || 0.5;
      return [low < 0 || low - pad > 0 ? low - pad : 0, high + pad];
    };
    return {
      width: Math.max(this.host.clientWidth, 200), height: PlanChart.HEIGHT, legend: { show: false },
      cursor: { drag: { x: false, y: false }, points: { size: 7 }, y: false },
      scales: { x: { time: false, range: () => [0, this.plan.s.at(-1) || 1] }, y: { range: fromZero }, second: { range: padded } },
      axes: [
        axis({ size: 30, values: (_, ticks) => ticks.map((s) => `${+s.toPrecision(6)} m`) }),
        axis({ size: 46 }),
        ...(second ? [axis({ scale: "second", side: 1, size: 46, stroke: colour("lane"), grid: { show: false } })] : []),
      ],
      series: [{}, line("accent"), line("limit", { dash: [6, 4], width: 1.4 }), ...(second ? [line("lane", { scale: "second", width: 1.2 })] : [])],
      hooks: {
        setCursor: [(chart) => {
          const { idx, left, top } = chart.cursor;
          if (idx !== null && idx !== undefined && left >= 0) this.onHover(idx, left + chart.over.offsetLeft, top + chart.over.offsetTop);
        }],
        draw: [() => this.show(this.row)],
      },
    };
  }

  redraw() {
    this.chart.redraw();
  }

  /* Move the mark to a row. */
  show(row) {
    this.row = row;
    if (!this.mark) return;
    this.mark.style.transform = `translateX(${this.chart.valToPos(this.plan.s[row], "x")}px)`;
  }
}
