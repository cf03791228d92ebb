// The charts of a trial: lines and ranges over time by uPlot, with the run shaded, the events marked, and a needle at the
// selected time.
"use strict";

const MARKS = { fault: ["bad", "▲"], warning: ["model", "△"], retry: ["model", "↻"], note: ["soft", "•"] };

biflag.Chart = class {
  /** `element`: the place for the plot. `trial`: see player.js. */
  constructor(element, name, trial) {
    this.element = element;
    this.trial = trial;
    this.name = name;
    this.spec = biflag.CHARTS[name];
    const table = trial.tables[this.spec.table];
    /** The samples, or the stretches if there are too many samples. */
    this.table = table.ranges ?? table;
    if (this.spec.error) this.errors = this.errorsOfRun();
    this.build();
  }

  /** The curves that the log has and the legend does not hide. Bars of zero height only hide other curves. */
  get lines() {
    const isThere = (line) => this.table[line.name] && (!line.bars || this.table[line.name].some((n) => n > 0));
    return this.spec.lines.filter((line) => isThere(line) && !this.trial.hidden.has(line.key ?? line.name));
  }

  /** Draws the chart anew, in the present colours and width. */
  build() {
    const range = this.plot ? { ...this.plot.scales.x } : null;
    this.plot?.destroy();
    this.element.replaceChildren();
    const { spec, table } = this;
    const data = this.columns();
    const series = [{}, ...this.lines.map((line) => this.series(line))];
    const bands = [];
    const edge = { points: { show: false } };
    for (const line of this.lines) {
      if (!table[line.name + "_low"]) continue;
      data.push(table[line.name + "_high"], table[line.name + "_low"]);
      series.push({ ...edge, width: 0 }, { ...edge, width: 0 });
      bands.push({ series: [data.length - 2, data.length - 1], fill: biflag.colour(line.colour) + "48" });
    }
    const limits = this.limits();
    if (limits) {
      data.push(...limits);
      const thin = { ...edge, stroke: biflag.colour("measured"), width: 1, dash: [3, 3] };
      series.push({ ...thin }, { ...thin });
      bands.push({ series: [data.length - 2, data.length - 1], fill: biflag.colour("measured") + "22" });
    }
    const axis = {
      stroke: biflag.colour("soft"),
      font: (this.isOnPaper ? "9px " : "12px ") + biflag.colour("font"),
      grid: { stroke: biflag.colour("grid"), width: 1 },
      ticks: { show: false },
    };
    const sign = (_, values) => values.map((v) => (v === null ? "" : String(Number(v.toFixed(6))).replace("-", "−") + (spec.unit === "°" ? "°" : "")));
    const options = {
      width: this.width(),
      height: this.height(),
      legend: { show: false },
      padding: [this.isStrip ? 6 : 10, 22, 0, 0],
      bands,
      series,
      scales: { x: { time: false }, y: { range: (_, low, high) => this.span(low, high) } },
      axes: [
        { ...axis, values: (_, values) => values.map((v) => v + " s"), space: 60, size: this.isOnPaper ? 20 : 30 },
        { ...axis, values: sign, size: 52, space: (_, _i, _low, _high, size) => Math.min(size / 4, this.isOnPaper ? 14 : this.isStrip ? 20 : 34) },
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

  /** The values of the curves over their times. */
  columns() {
    return [this.table.time, ...this.lines.map((line) => this.table[line.name])];
  }

  /** Draws what was added to the table of a running trial. */
  grow() {
    this.plot.setData(this.columns());
    this.zoom(null);
  }

  /** A low chart below another one does not repeat the marks. */
  get isStrip() {
    return this.spec.strip || this.spec.error;
  }

  /** The limits of the 95 % uncertainty about the measured curve, or about zero for an error; null without them. */
  limits() {
    const { spec, table } = this;
    const uncertainty = table[spec.uncertainty];
    const middle = table[spec.lines[0].name];
    if (!uncertainty || !middle || this.trial.hidden.has("uncertainty")) return null;
    const limit = (sign) => middle.map((v, i) => (v === null || uncertainty[i] === null ? null : (spec.error ? 0 : v) + sign * uncertainty[i]));
    return [limit(1), limit(-1)];
  }

  /** The smallest and the largest error from the start of the run on, with the uncertainty about zero. */
  errorsOfRun() {
    const { table, spec, trial } = this;
    const start = trial.data.phases.find(([name]) => name === "run")?.[1] ?? 0;
    const { name } = spec.lines[0];
    let [low, high] = [0, 0];
    table.time.forEach((time, i) => {
      if (time < start) return;
      const uncertainty = table[spec.uncertainty]?.[i] ?? 0;
      low = Math.min(low, -uncertainty, (table[name + "_low"] ?? table[name])[i] ?? 0);
      high = Math.max(high, uncertainty, (table[name + "_high"] ?? table[name])[i] ?? 0);
    });
    return [low, high];
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
      return `${biflag.label(line, this.trial.data)} ${text(line.name)}${range}`;
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
    // Before the run, an error says nothing: the filter may still settle, and neither attitude has its zero.
    if (this.spec.error) [low, high] = [Math.max(low, Math.min(high, this.errors[0])), Math.min(high, Math.max(low, this.errors[1]))];
    const least = this.spec.least;
    const missing = Math.max(0, least - (high - low)) / 2;
    const room = 0.06 * Math.max(high - low, least);
    return this.spec.table === "link" ? [0, Math.max(1, high * 1.1)] : [low - missing - room, high + missing + room];
  }

  get isOnPaper() {
    return document.documentElement.classList.contains("paper");
  }

  /** On paper, a trial has a page. */
  height() {
    return Math.round(this.spec.height * (this.isOnPaper ? 0.48 : 1));
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

  /** Shades the time in which the flagella touch. */
  contact(u, x) {
    const { ctx, bbox } = u;
    const { time, contact } = this.table;
    ctx.fillStyle = biflag.colour("contact");
    for (let i = 0; i < time.length; i++) {
      if (!contact[i]) continue;
      const [from, to] = this.stretch(i);
      ctx.fillRect(x(from), bbox.top, Math.max(x(to) - x(from), 1), bbox.height);
    }
  }

  /** The time of a row: about its middle where rows are stretches of many samples, to the next sample elsewhere. */
  stretch(i) {
    const { time, width = 0 } = this.table;
    return width ? [time[i] - width / 2, time[i] + width / 2] : [time[i], time[i + 1] ?? time[i]];
  }

  phases(u) {
    const { ctx, bbox } = u;
    const x = (t) => Math.min(Math.max(u.valToPos(t, "x", true), bbox.left), bbox.left + bbox.width);
    ctx.save();
    ctx.fillStyle = biflag.colour("run");
    for (const [name, from, to] of this.trial.data.phases) {
      if (name === "run") ctx.fillRect(x(from), bbox.top, Math.max(x(to) - x(from), 0), bbox.height);
    }
    if (this.spec.contact) this.contact(u, x);
    ctx.restore();
  }

  marks(u) {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.font = `${(this.isOnPaper ? 9 : 12) * devicePixelRatio}px ${biflag.colour("font")}`;
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
      if (!this.isStrip) ctx.fillText(sign, x, bbox.top + devicePixelRatio);
    }
    ctx.restore();
  }

  /** The plot as the elements of an SVG: axes, phases, contact, bands and curves. */
  svg() {
    const { plot, spec, table } = this;
    const { left, top, width, height } = Object.fromEntries(Object.entries(plot.bbox).map(([key, value]) => [key, value / devicePixelRatio]));
    const place = (value, scale) => plot.valToPos(value, scale) + (scale === "x" ? left : top);
    const clip = (t) => Math.min(Math.max(place(t, "x"), left), left + width);
    const parts = [];
    const block = (from, to, colour) => parts.push(`<rect x="${clip(from).toFixed(1)}" y="${top}" width="${Math.max(clip(to) - clip(from), 0).toFixed(1)}" height="${height}" fill="${colour}"/>`);
    for (const [name, from, to] of this.trial.data.phases) if (name === "run") block(from, to, biflag.colour("run"));
    if (spec.contact) table.time.forEach((_, i) => table.contact[i] && block(...this.stretch(i), biflag.colour("contact")));
    for (const [i, axis] of plot.axes.entries()) {
      axis._splits.forEach((split, k) => {
        const label = axis._values[k];
        const at = place(split, i ? "y" : "x").toFixed(1);
        const line = i ? `M${left} ${at}h${width}` : `M${at} ${top}v${height}`;
        const words = i ? `x="${left - 6}" y="${Number(at) + 4}" text-anchor="end"` : `x="${at}" y="${top + height + 18}" text-anchor="middle"`;
        parts.push(`<path d="${line}" stroke="${biflag.colour("grid")}"/><text ${words}>${label ?? ""}</text>`);
      });
    }
    const id = `clip-${this.trial.id}-${this.name}`;
    parts.push(`<clipPath id="${id}"><rect x="${left}" y="${top}" width="${width}" height="${height}"/></clipPath><g clip-path="url(#${id})" fill="none">`);
    const path = (values) => {
      let [d, pen] = ["", "M"];
      values.forEach((value, i) => {
        if (value === null) return void (pen = "M");
        d += `${pen}${place(table.time[i], "x").toFixed(1)} ${place(value, "y").toFixed(2)}`;
        pen = "L";
      });
      return d;
    };
    const drawn = [...this.lines.map((line) => [line, table[line.name]]), ...(this.limits() ?? []).map((values) => [{ colour: "measured", width: 1, dash: [3, 3] }, values])];
    for (const [line, values] of drawn) {
      const [low, high] = [table[line.name + "_low"], table[line.name + "_high"]];
      for (const edge of [low, high].filter(Boolean)) parts.push(`<path d="${path(edge)}" stroke="${biflag.colour(line.colour)}" stroke-opacity="0.35"/>`);
      const dash = line.dash ? ` stroke-dasharray="${line.dash}"` : "";
      parts.push(`<path d="${path(values)}" stroke="${biflag.colour(line.colour)}" stroke-width="${line.width ?? 2}" stroke-linejoin="round"${dash}/>`);
    }
    return parts.join("") + "</g>";
  }
};
