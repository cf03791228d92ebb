// The charts of a trial: lines over time by uPlot, with the phases shaded, events marked, and a needle at the time shown.
"use strict";

/** What each chart draws: a column of the data, its colour, and how the line looks. */
biflag.CHARTS = {
  yaw: { table: "attitude", unit: "°", height: 220, lines: biflag_angle("yaw"), band: "band" },
  pitch: { table: "attitude", unit: "°", height: 160, lines: biflag_angle("pitch") },
  roll: { table: "attitude", unit: "°", height: 160, lines: biflag_angle("roll") },
  motors: {
    table: "motors",
    unit: " rpm",
    height: 170,
    lines: [
      { name: "speed1", colour: "flagellum1", width: 2 },
      { name: "speed2", colour: "flagellum2", width: 2 },
      { name: "asked1", colour: "ink", width: 1, dash: [6, 10] },
      { name: "asked2", colour: "ink", width: 1, dash: [2, 8] },
    ],
  },
  link: {
    table: "link",
    unit: "",
    height: 150,
    lines: [
      { name: "received", colour: "measured", width: 1.5, stepped: true },
      { name: "lost", colour: "bad", bars: true },
      { name: "retries", colour: "model", bars: true },
      { name: "board", colour: "flagellum1", bars: true },
    ],
  },
};

function biflag_angle(name) {
  return [
    { name, colour: "measured", width: 2 },
    { name: "model_" + name, colour: "model", width: 2, dash: [8, 4] },
    { name: "true_" + name, colour: "truth", width: 1.5, dash: [2, 3] },
  ];
}

const MARKS = { fault: ["bad", "▲"], warning: ["model", "△"], retry: ["model", "↻"], note: ["soft", "•"] };

biflag.Chart = class {
  /** `element`: the place for the plot. `trial`: see player.js. */
  constructor(element, name, trial) {
    this.element = element;
    this.trial = trial;
    this.spec = biflag.CHARTS[name];
    this.table = trial.tables[this.spec.table];
    this.lines = this.spec.lines.filter((line) => this.table[line.name]);
    // Bars that count nothing only hide the others.
    this.lines = this.lines.filter((line) => !line.bars || this.table[line.name].some((n) => n > 0));
    this.build();
  }

  /** Draws it anew, in the colours and the width that now hold. */
  build() {
    const range = this.plot ? { ...this.plot.scales.x } : null;
    this.plot?.destroy();
    this.element.replaceChildren();
    const { spec, table } = this;
    const data = [table.time, ...this.lines.map((line) => table[line.name])];
    const series = [{}, ...this.lines.map((line) => this.series(line))];
    const bands = [];
    if (spec.band && table[spec.band]) {
      const middle = table[this.lines[0].name];
      const edge = (sign) => middle.map((v, i) => (v === null || table[spec.band][i] === null ? null : v + sign * table[spec.band][i]));
      data.push(edge(1), edge(-1));
      series.push({ width: 0, points: { show: false } }, { width: 0, points: { show: false } });
      bands.push({ series: [data.length - 2, data.length - 1], fill: biflag.colour("band") });
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
        setCursor: [(u) => this.trial.hover(u.cursor.left >= 0 ? u.posToVal(u.cursor.left, "x") : null)],
        setSelect: [(u) => u.select.width > 0 && this.trial.zoom([u.posToVal(u.select.left, "x"), u.posToVal(u.select.left + u.select.width, "x")])],
      },
    };
    this.plot = new uPlot(options, data, this.element);
    this.plot.over.addEventListener("click", (event) => {
      if (!this.plot.select.width) this.trial.seek(this.plot.posToVal(event.offsetX, "x"));
    });
    this.needle = document.createElement("div");
    this.needle.className = "needle";
    this.plot.over.append(this.needle);
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

  /** Limits of the axis: some room about the values, and never less than a degree, so that noise looks like noise. */
  span(low, high) {
    if (low === null || high === null) return [0, 1];
    const least = this.spec.unit === "°" ? 1 : 2;
    const missing = Math.max(0, least - (high - low)) / 2;
    const room = 0.06 * Math.max(high - low, least);
    return this.spec.table === "link" ? [0, Math.max(1, high * 1.1)] : [low - missing - room, high + missing + room];
  }

  /** Paper is short. */
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
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
      ctx.fillText(sign, x, bbox.top - 3 * devicePixelRatio);
    }
    ctx.restore();
  }
};
