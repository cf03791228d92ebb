// The charts of a trial: lines and ranges over time by uPlot, with the phases shaded, the events marked, and a needle at the
// selected time.
"use strict";

/** What each chart draws: columns of a table, their names, colours and styles. */
biflag.CHARTS = {
  yaw: { table: "attitude", unit: "°", decimals: 2, height: 220, lines: biflag_angle("yaw"), uncertainty: "uncertainty" },
  pitch: { table: "attitude", unit: "°", decimals: 2, height: 160, lines: biflag_angle("pitch") },
  roll: { table: "attitude", unit: "°", decimals: 2, height: 160, lines: biflag_angle("roll") },
  motors: {
    table: "motors",
    unit: " rpm",
    decimals: 1,
    height: 170,
    lines: [
      { name: "speed1", label: "flagellum 1", colour: "flagellum1", width: 2 },
      { name: "speed2", label: "flagellum 2", colour: "flagellum2", width: 2 },
      { name: "target1", label: "target 1", colour: "ink", width: 1, dash: [6, 10] },
      { name: "target2", label: "target 2", colour: "ink", width: 1, dash: [2, 8] },
    ],
  },
  link: {
    table: "link",
    unit: "",
    decimals: 0,
    height: 150,
    lines: [
      { name: "received", label: "received", colour: "measured", width: 1.5, stepped: true },
      { name: "lost", label: "lost", colour: "bad", bars: true },
      { name: "retries", label: "retries", colour: "model", bars: true },
      { name: "board", label: "board errors", colour: "flagellum1", bars: true },
    ],
  },
};

function biflag_angle(name) {
  return [
    { name, colour: "measured", width: 2 },
    { name: "model_" + name, label: "model", colour: "model", width: 2, dash: [8, 4] },
    { name: "true_" + name, label: "truth", colour: "truth", width: 1.5, dash: [2, 3] },
  ];
}

const MARKS = { fault: ["bad", "▲"], warning: ["model", "△"], retry: ["model", "↻"], note: ["soft", "•"] };

biflag.Chart = class {
  /** `element`: the place for the plot. `trial`: see player.js. */
  constructor(element, name, trial) {
    this.element = element;
    this.trial = trial;
    this.spec = biflag.CHARTS[name];
    const table = trial.tables[this.spec.table];
    /** The samples, or the stretches if there are too many samples. */
    this.table = table.ranges ?? table;
    this.lines = this.spec.lines.filter((line) => this.table[line.name]);
    // Bars of zero height only hide the other lines.
    this.lines = this.lines.filter((line) => !line.bars || this.table[line.name].some((n) => n > 0));
    this.build();
  }

  /** Draws the chart anew, in the present colours and width. */
  build() {
    const range = this.plot ? { ...this.plot.scales.x } : null;
    this.plot?.destroy();
    this.element.replaceChildren();
    const { spec, table } = this;
    const data = [table.time, ...this.lines.map((line) => table[line.name])];
    const series = [{}, ...this.lines.map((line) => this.series(line))];
    const bands = [];
    const edge = { points: { show: false } };
    for (const line of this.lines) {
      if (!table[line.name + "_low"]) continue;
      data.push(table[line.name + "_high"], table[line.name + "_low"]);
      series.push({ ...edge, width: 0 }, { ...edge, width: 0 });
      bands.push({ series: [data.length - 2, data.length - 1], fill: biflag.colour(line.colour) + "48" });
    }
    if (table[spec.uncertainty]) {
      const [middle, uncertainty] = [table[this.lines[0].name], table[spec.uncertainty]];
      const limit = (sign) => middle.map((v, i) => (v === null || uncertainty[i] === null ? null : v + sign * uncertainty[i]));
      data.push(limit(1), limit(-1));
      const thin = { ...edge, stroke: biflag.colour("measured"), width: 1, dash: [3, 3] };
      series.push({ ...thin }, { ...thin });
    }
    const axis = {
      stroke: biflag.colour("soft"),
      font: "12px " + biflag.colour("font"),
      grid: { stroke: biflag.colour("grid"), width: 1 },
      ticks: { show: false },
    };
    const sign = (_, values) => values.map((v) => (v === null ? "" : String(Number(v.toFixed(6))).replace("-", "−") + spec.unit.trim().replace("rpm", "")));
    const options = {
      width: this.width(),
      height: this.height(),
      legend: { show: false },
      padding: [20, 22, 0, 0],
      bands,
      series,
      scales: { x: { time: false }, y: { range: (_, low, high) => this.span(low, high) } },
      axes: [
        { ...axis, values: (_, values) => values.map((v) => v + " s"), space: 60, size: 30 },
        { ...axis, values: sign, size: 52, space: 34 },
      ],
      cursor: {
        y: false,
        drag: { x: true, y: false, uni: 20 },
        sync: { key: this.trial.id, setSeries: false },
        points: { size: 7 },
        bind: { dblclick: () => () => this.trial.zoom(null) },
      },
      hooks: {
        drawClear: [(u) => this.phases(u)],
        draw: [(u) => this.marks(u)],
        setCursor: [(u) => this.hover(u)],
        setSelect: [(u) => u.select.width > 0 && this.trial.zoom([u.posToVal(u.select.left, "x"), u.posToVal(u.select.left + u.select.width, "x")])],
      },
    };
    this.plot = new uPlot(options, data, this.element);
    this.plot.over.addEventListener("click", (event) => {
      if (!this.plot.select.width) this.trial.seek(this.plot.posToVal(event.offsetX, "x"));
    });
    this.needle = document.createElement("div");
    this.needle.className = "needle";
    this.tooltip = document.createElement("div");
    this.tooltip.className = "tooltip";
    this.tooltip.hidden = true;
    this.plot.over.append(this.needle, this.tooltip);
    this.zoom(range && range.min !== null ? [range.min, range.max] : null);
    this.point(this.trial.time);
  }

  series(line) {
    const colour = biflag.colour(line.colour);
    const shared = { stroke: colour, points: { show: false } };
    if (line.bars) return { ...shared, fill: colour, width: 0, paths: uPlot.paths.bars({ size: [0.8, 40, 2], align: 1 }) };
    if (line.stepped) return { ...shared, width: line.width, paths: uPlot.paths.stepped({ align: 1 }) };
    return { ...shared, width: line.width, dash: line.dash };
  }

  /** The values under the pointer, or the mean and the range of the stretch under it, at the top of the chart. */
  hover(u) {
    const { left, idx } = u.cursor;
    const inside = left >= 0 && idx !== null && idx !== undefined;
    this.trial.hover(inside ? u.posToVal(left, "x") : null);
    // The pointer is in one chart, the cursor in all of them.
    this.tooltip.hidden = !inside || !u.over.matches(":hover");
    if (this.tooltip.hidden) return;
    const { table, spec } = this;
    const text = (column) => biflag.format(table[column]?.[idx], spec.decimals);
    const values = this.lines.map((line) => {
      const range = table[line.name + "_low"] ? ` (${text(line.name + "_low")} to ${text(line.name + "_high")})` : "";
      return `${line.label ?? this.trial.data.own} ${text(line.name)}${range}`;
    });
    const time = table.time[idx];
    const half = (table.width ?? 0) / 2;
    const stretch = half ? `${(time - half).toFixed(2)} to ${(time + half).toFixed(2)} s, mean (range)` : `${time.toFixed(2)} s`;
    this.tooltip.replaceChildren(...[stretch, ...values].map((line) => Object.assign(document.createElement("div"), { textContent: line })));
    const right = left > this.plot.over.clientWidth / 2;
    this.tooltip.style.left = right ? "" : `${left + 10}px`;
    this.tooltip.style.right = right ? `${this.plot.over.clientWidth - left + 10}px` : "";
  }

  /** Limits of the axis: some room about the values, and at least a degree, so that noise looks like noise. */
  span(low, high) {
    if (low === null || high === null) return [0, 1];
    const least = this.spec.unit === "°" ? 1 : 2;
    const missing = Math.max(0, least - (high - low)) / 2;
    const room = 0.06 * Math.max(high - low, least);
    return this.spec.table === "link" ? [0, Math.max(1, high * 1.1)] : [low - missing - room, high + missing + room];
  }

  /** Charts are lower on paper. */
  height() {
    return Math.round(this.spec.height * (document.documentElement.classList.contains("paper") ? 0.8 : 1));
  }

  width() {
    return Math.max(240, Math.floor(this.element.clientWidth));
  }

  resize() {
    this.plot.setSize({ width: this.width(), height: this.height() });
    this.point(this.trial.time);
  }

  zoom(range) {
    const [min, max] = range ?? [0, this.trial.end];
    this.plot.setScale("x", { min, max });
  }

  /** Puts the needle at a time. */
  point(time) {
    const x = this.plot.valToPos(time, "x");
    const inside = x >= 0 && x <= this.plot.over.clientWidth;
    this.needle.hidden = !inside;
    if (inside) this.needle.style.transform = `translateX(${x}px)`;
  }

  phases(u) {
    const { ctx, bbox } = u;
    const x = (t) => Math.min(Math.max(u.valToPos(t, "x", true), bbox.left), bbox.left + bbox.width);
    ctx.save();
    ctx.font = `${11 * devicePixelRatio}px ${biflag.colour("font")}`;
    ctx.textBaseline = "top";
    for (const [name, from, to] of this.trial.data.phases) {
      const [left, right] = [x(from), x(to)];
      if (right <= left) continue;
      if (name === "run") {
        ctx.fillStyle = biflag.colour("run");
        ctx.fillRect(left, bbox.top, right - left, bbox.height);
      }
      if (right - left > ctx.measureText(name).width + 4 * devicePixelRatio) {
        ctx.fillStyle = biflag.colour("soft");
        ctx.fillText(name, left, bbox.top - 16 * devicePixelRatio);
      }
    }
    ctx.restore();
  }

  marks(u) {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.font = `${12 * devicePixelRatio}px ${biflag.colour("font")}`;
    ctx.textAlign = "center";
    for (const [time, kind] of this.trial.data.marks) {
      const x = u.valToPos(time, "x", true);
      if (x < bbox.left || x > bbox.left + bbox.width) continue;
      const [colour, sign] = MARKS[kind];
      ctx.strokeStyle = ctx.fillStyle = biflag.colour(colour);
      ctx.setLineDash(kind === "fault" ? [] : [3 * devicePixelRatio, 3 * devicePixelRatio]);
      ctx.lineWidth = devicePixelRatio;
      // A model's log has a note for each change of the bundling: too many lines hide the curves.
      if (kind !== "note") {
        ctx.beginPath();
        ctx.moveTo(x, bbox.top);
        ctx.lineTo(x, bbox.top + bbox.height);
        ctx.stroke();
      }
      ctx.fillText(sign, x, bbox.top + devicePixelRatio);
    }
    ctx.restore();
  }
};
