// The page of a swept table: a map of one result over two inputs, and a slider for each other input.
"use strict";

biflag.SweepMap = class {
  static VIRIDIS = ["440154", "482475", "414487", "355f8d", "2a788e", "21918c", "22a884", "44bf70", "7ad151", "bddf26", "fde725"];
  /** More distinct values than this make no cells, and no steps of a slider: these become tenths of the points. */
  static MOST_STEPS = 60;

  constructor(element) {
    this.element = element;
    const { inputs, results } = JSON.parse(document.getElementById(element.dataset.data).textContent);
    // Numbers of 32 bits have seven digits.
    const value = (v) => (Number.isNaN(v) ? null : Number(v.toPrecision(7)));
    const column = ({ name, values }) => ({ name, values: biflag.numbers(values).map(value) });
    this.inputs = inputs.map(column).map((input) => ({ ...input, steps: biflag.SweepMap.steps(input.values) }));
    this.results = results.map(column);
    this.choices = Object.fromEntries(["x", "y", "value"].map((name) => [name, element.querySelector(`[name=${name}]`)]));
    for (const select of Object.values(this.choices)) select.addEventListener("change", () => this.rebuild());
    this.rebuild();
  }

  /** The values that a slider stops at: each distinct one, or tenths of the points as ranges. */
  static steps(values) {
    const sorted = [...new Set(values)].filter((value) => value !== null).sort((a, b) => a - b);
    if (sorted.length <= biflag.SweepMap.MOST_STEPS) return sorted.map((value) => ({ from: value, to: value }));
    const at = (share) => sorted[Math.min(Math.floor(share * sorted.length), sorted.length - 1)];
    return Array.from({ length: 10 }, (_, i) => ({ from: at(i / 10), to: at((i + 1) / 10) }));
  }

  /** The step that most points have, the middle one of equals: in a sweep of one input at a time, that of the robot itself. */
  static commonest(values, steps) {
    const counts = new Map();
    for (const value of values) counts.set(value, (counts.get(value) ?? 0) + 1);
    const count = ({ from }) => counts.get(from) ?? 0;
    return steps.reduce((best, step, i) => (count(step) > count(steps[best]) ? i : best), steps.length >> 1);
  }

  static text(value) {
    return String(Number(value.toPrecision(4))).replace("-", "−");
  }

  chosen(name) {
    const { value } = this.choices[name];
    return (name === "value" ? this.results : this.inputs).find((column) => column.name === value);
  }

  /** Makes the sliders of the inputs that are no axis. */
  rebuild() {
    const others = this.inputs.filter((input) => ![this.choices.x.value, this.choices.y.value].includes(input.name));
    const place = this.element.querySelector(".sliders");
    place.replaceChildren(...others.map((input) => {
      const label = document.createElement("label");
      const output = document.createElement("output");
      // Scattered points have no common values: at first all are shown.
      const isScattered = input.steps[0].from !== input.steps[0].to;
      const slider = Object.assign(document.createElement("input"), { type: "range", min: isScattered ? -1 : 0, max: input.steps.length - 1 });
      input.usual = isScattered ? -1 : biflag.SweepMap.commonest(input.values, input.steps);
      input.step ??= input.usual;
      slider.addEventListener("input", () => {
        input.step = Number(slider.value);
        // Not every combination was computed: then only this input leaves its usual value.
        if (!this.rows().length) for (const other of others) if (other !== input) other.step = other.usual;
        for (const other of others) other.show();
        this.draw();
      });
      input.show = () => {
        slider.value = input.step;
        const step = input.steps[input.step];
        const { text } = biflag.SweepMap;
        output.textContent = !step ? "all" : step.from === step.to ? text(step.from) : `${text(step.from)} to ${text(step.to)}`;
      };
      input.show();
      label.append(`${input.name} `, slider, output);
      return label;
    }));
    this.others = others;
    this.draw();
  }

  /** The rows that the sliders choose. */
  rows() {
    const [x, y, value] = ["x", "y", "value"].map((name) => this.chosen(name).values);
    const isChosen = (i) => this.others.every(({ values, steps, step }) => step < 0 || (values[i] >= steps[step].from && values[i] <= steps[step].to));
    return value.map((v, i) => [x[i], y[i], v, i]).filter(([a, b, v, i]) => a !== null && b !== null && v !== null && isChosen(i));
  }

  draw() {
    const [x, y, value] = ["x", "y", "value"].map((name) => this.chosen(name));
    const rows = this.rows();
    const figure = this.element.querySelector("figure");
    const title = `${value.name} over ${x.name} and ${y.name}`;
    figure.querySelector("h3").textContent = title;
    const [width, height, left, top, right, bottom] = [760, 520, 70, 14, 110, 52];
    const axis = (column, from, to) => {
      const isGrid = column.steps[0].from === column.steps[0].to;
      const finite = column.values.filter((v) => v !== null);
      const [low, high] = finite.reduce(([a, b], v) => [Math.min(a, v), Math.max(b, v)], [Infinity, -Infinity]);
      // Cells are even, whatever the spacing of the values; dots are where their values are.
      const place = isGrid
        ? (v) => from + ((column.steps.findIndex((step) => step.from === v) + 0.5) / column.steps.length) * (to - from)
        : (v) => from + (0.03 + (0.94 * (v - low)) / (high - low || 1)) * (to - from);
      const all = isGrid ? column.steps.map((step) => step.from) : Array.from({ length: 6 }, (_, i) => low + (i / 5) * (high - low));
      const every = Math.ceil(all.length / 10);
      return { place, ticks: all.filter((_, i) => i % every === 0), cell: isGrid ? Math.abs(to - from) / column.steps.length : 0 };
    };
    const [across, up] = [axis(x, left, width - right), axis(y, height - bottom, top)];
    // The scale is that of the whole table, so that the sliders do not change it.
    const finite = value.values.filter((v) => v !== null);
    const [low, high] = finite.reduce(([a, b], v) => [Math.min(a, v), Math.max(b, v)], [Infinity, -Infinity]);
    const colour = (v) => {
      const place = (10 * (v - low)) / (high - low || 1);
      const i = Math.min(Math.max(Math.floor(place), 0), 9);
      const part = (hex, k) => parseInt(hex.slice(2 * k, 2 * k + 2), 16);
      const [a, b] = biflag.SweepMap.VIRIDIS.slice(i, i + 2);
      return `rgb(${[0, 1, 2].map((k) => Math.round(part(a, k) + (part(b, k) - part(a, k)) * (place - i))).join(" ")})`;
    };
    const { text } = biflag.SweepMap;
    const isCells = across.cell > 0 && up.cell > 0;
    const marks = rows.map(([a, b, v]) => {
      const [cx, cy] = [across.place(a), up.place(b)];
      const words = `<title>${x.name} ${text(a)}, ${y.name} ${text(b)}: ${text(v)}</title>`;
      const shape = isCells
        ? `rect x="${(cx - across.cell / 2).toFixed(1)}" y="${(cy - up.cell / 2).toFixed(1)}" width="${across.cell.toFixed(1)}" height="${up.cell.toFixed(1)}"`
        : `circle cx="${cx.toFixed(1)}" cy="${cy.toFixed(1)}" r="4"`;
      return `<${shape} data-at="${a},${b},${v}" fill="${colour(v)}">${words}</${isCells ? "rect" : "circle"}>`;
    });
    const frame = `<path class="empty" d="M${left} ${top}H${width - right}V${height - bottom}H${left}Z"></path>`;
    const labels = [
      ...across.ticks.map((v) => `<text x="${across.place(v).toFixed(1)}" y="${height - bottom + 16}" text-anchor="middle">${text(v)}</text>`),
      ...up.ticks.map((v) => `<text x="${left - 6}" y="${(up.place(v) + 4).toFixed(1)}" text-anchor="end">${text(v)}</text>`),
      `<text x="${(left + width - right) / 2}" y="${height - 10}" text-anchor="middle">${x.name}</text>`,
      `<text transform="translate(14 ${(top + height - bottom) / 2}) rotate(-90)" text-anchor="middle">${y.name}</text>`,
    ];
    const scale = Array.from({ length: 50 }, (_, i) => {
      const step = (height - bottom - top) / 50;
      const v = low + ((i + 0.5) / 50) * (high - low);
      return `<rect x="${width - right + 24}" y="${(height - bottom - (i + 1) * step).toFixed(1)}" width="14" height="${(step + 0.5).toFixed(1)}" fill="${colour(v)}"></rect>`;
    });
    const ends = [0, 0.5, 1].map((share) => `<text x="${width - right + 43}" y="${height - bottom - share * (height - bottom - top - 9)}">${text(low + share * (high - low))}</text>`);
    const svg = figure.querySelector("svg");
    svg.innerHTML = [frame, ...marks, ...labels, ...scale, ...ends].join("");
    svg.setAttribute("aria-label", title);
    Object.assign(svg.dataset, { x: x.name, y: y.name, value: value.name });
    const failed = this.inputs[0].values.length - finite.length;
    figure.querySelector("figcaption").textContent = `${rows.length} of ${this.inputs[0].values.length} points; ${failed} have no ${value.name}. The colours span the whole table.`;
  }
};

for (const element of document.querySelectorAll(".sweep")) new biflag.SweepMap(element);
