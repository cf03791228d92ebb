// The page of a swept table: one result over two inputs as a map or as lines, and a slider for each other input. A map has
// cells and contours where its points fill a grid, and a dot for each point elsewhere.
"use strict";

biflag.SweepMap = class {
  static VIRIDIS = ["440154", "482475", "414487", "355f8d", "2a788e", "21918c", "22a884", "44bf70", "7ad151", "bddf26", "fde725"];
  /** From blue through white to red (ColorBrewer's RdBu), for values of both signs. */
  static DIVERGING = ["2166ac", "4393c3", "92c5de", "d1e5f0", "f7f7f7", "fddbc7", "f4a582", "d6604d", "b2182b"];
  /** Curves: the colours of Okabe and Ito, for any colour vision; later ones are dashed. */
  static CURVES = ["0072b2", "d55e00", "009e73", "cc79a7", "8a6d00", "5a6570"];
  /** The largest number of curves in a drawing. */
  static MOST_CURVES = 12;

  constructor(element) {
    this.element = element;
    this.swept = new biflag.Swept(JSON.parse(document.getElementById(element.dataset.data).textContent));
    this.choices = Object.fromEntries(["x", "y", "value", "view"].map((name) => [name, element.querySelector(`[name=${name}]`)]));
    for (const name of ["x", "y"]) this.choices[name].addEventListener("change", () => this.chooseAxes());
    for (const name of ["value", "view"]) this.choices[name].addEventListener("change", () => this.draw());
    new ResizeObserver(() => this.draw()).observe(element.querySelector("figure"));
    this.axes = this.swept.bestAxes();
    this.rebuild();
  }

  static text(value) {
    return String(Number(value.toPrecision(4))).replace("-", "−");
  }

  static escaped(text) {
    return text.replace(/[&<>"]/g, (sign) => `&#${sign.charCodeAt(0)};`);
  }

  /** The colour at a share of a scale. */
  static mix(colours, share) {
    const place = share * (colours.length - 1);
    const i = Math.min(Math.max(Math.floor(place), 0), colours.length - 2);
    const part = (hex, k) => parseInt(hex.slice(2 * k, 2 * k + 2), 16);
    return `rgb(${[0, 1, 2].map((k) => Math.round(part(colours[i], k) + (part(colours[i + 1], k) - part(colours[i], k)) * (place - i))).join(" ")})`;
  }

  static range(values) {
    return values.reduce(([a, b], v) => (v === null ? [a, b] : [Math.min(a, v), Math.max(b, v)]), [Infinity, -Infinity]);
  }

  /** Round values within a range, about so many. */
  static round(low, high, count) {
    const step = biflag.roundBelow(Math.max((high - low) / count, 1e-12));
    const first = Math.ceil(low / step - 1e-9);
    return Array.from({ length: Math.max(Math.floor(high / step + 1e-9) - first + 1, 0) }, (_, i) => Number(((first + i) * step).toPrecision(7)));
  }

  /** Takes over the chosen axes; they change places if one is chosen for both. */
  chooseAxes() {
    const axes = ["x", "y"].map((axis) => this.swept.inputs.find((input) => input.name === this.choices[axis].value));
    this.axes = axes[0] === axes[1] ? this.axes.toReversed() : axes;
    this.rebuild();
  }

  /** Makes the sliders of the inputs that are no axis. */
  rebuild() {
    this.axes.forEach((input, i) => (this.choices["xy"[i]].value = input.name));
    /** The step of each slider; -1 for all. */
    this.steps = this.swept.usual(...this.axes, this.swept.rows).steps;
    this.shows = [...this.steps].map(([input, usual]) => {
      const label = document.createElement("label");
      const output = document.createElement("output");
      const slider = Object.assign(document.createElement("input"), { type: "range", min: Math.min(usual, 0), max: input.steps.length - 1 });
      slider.addEventListener("input", () => this.move(input, Number(slider.value)));
      label.append(`${input.label} `, slider, output);
      const show = () => {
        slider.value = this.steps.get(input);
        const step = input.steps[slider.value];
        const { text } = biflag.SweepMap;
        output.textContent = !step ? "all" : step.from === step.to ? text(step.from) : `${text(step.from)} to ${text(step.to)}`;
      };
      return { label, show };
    });
    this.element.querySelector(".sliders").replaceChildren(...this.shows.map(({ label }) => label));
    this.follow();
  }

  /** Moves a slider. Not every combination was computed: the others go to the steps of the point that has most of theirs. */
  move(input, step) {
    this.steps.set(input, step);
    if (!this.rows().length) {
      const has = (other, row) => [-1, other.stepOf[row]].includes(this.steps.get(other));
      const { values } = this.result();
      const possible = this.swept.rows.filter((row) => values[row] !== null && has(input, row));
      const kept = (row) => [...this.steps.keys()].filter((other) => has(other, row)).length;
      const nearest = possible.reduce((best, row) => (kept(row) > kept(best) ? row : best), possible[0]);
      for (const other of this.steps.keys()) if (possible.length && !has(other, nearest)) this.steps.set(other, other.stepOf[nearest]);
    }
    this.follow();
  }

  /** Everything that follows the sliders. */
  follow() {
    for (const { show } of this.shows) show();
    this.draw();
  }

  result() {
    return this.swept.results.find(({ name }) => name === this.choices.value.value);
  }

  /** The rows that the sliders choose and that have a result. */
  rows() {
    const { values } = this.result();
    const chosen = [...this.steps].filter(([, step]) => step >= 0);
    return this.swept.rows.filter((row) => values[row] !== null && chosen.every(([input, step]) => input.stepOf[row] === step));
  }

  /** What is drawn at each place: both inputs, the mean of the results there, their number, the least steady of their states, and
   * whether a ring marks it. */
  points(rows) {
    const [[x, y], { values }] = [this.axes, this.result()];
    const places = new Map();
    for (const row of rows) {
      const [a, b] = [x.values[row], y.values[row]];
      if (a === null || b === null) continue;
      const point = places.get(`${a},${b}`) ?? { a, b, step: y.stepOf[row], sum: 0, count: 0, state: -1, isOdd: false };
      point.sum += values[row];
      point.count += 1;
      point.state = Math.max(point.state, this.swept.states[row]);
      point.isOdd ||= this.swept.isUnknown(point.state) || this.swept.isPhased(row);
      places.set(`${a},${b}`, point);
    }
    return [...places.values()].map(({ sum, ...point }) => ({ ...point, v: Number((sum / point.count).toPrecision(7)) }));
  }

  /** A point in words. */
  words({ a, b, v, count, state }) {
    const { text, escaped } = biflag.SweepMap;
    const [x, y] = this.axes;
    const of = count > 1 ? `, mean of ${count} points` : "";
    return `<title>${escaped(`${x.label} ${text(a)}; ${y.label} ${text(b)}: ${text(v)}${of}${state > 0 ? `, ${this.swept.kinds[state]}` : ""}`)}</title>`;
  }

  draw() {
    const figure = this.element.querySelector("figure");
    const [[x, y], value] = [this.axes, this.result()];
    const rows = this.rows();
    const points = this.points(rows);
    const isLines = this.choices.view.value === "lines";
    const [of, over, and] = [value, x, y].map(({ label }) => label.split(", ")[0]);
    const title = isLines ? `${of} over ${over}, for each ${and}` : `${of} over ${over} and ${and}`;
    figure.querySelector("h3").textContent = title;
    // On a phone the drawing is as wide as the page, so that its words stay legible.
    const width = Math.min(Math.max(figure.clientWidth - 30, 320), 760);
    const svg = figure.querySelector("svg");
    const box = { width, height: Math.round(0.55 * width) + 110, top: 14, bottom: 48, right: isLines ? 16 : 84 };
    svg.setAttribute("viewBox", `0 0 ${box.width} ${box.height}`);
    svg.innerHTML = isLines ? this.lines(box, x, y, value, points) : this.map(box, x, y, value, points);
    svg.setAttribute("aria-label", title);
    const isMean = points.length < rows.length;
    Object.assign(svg.dataset, { x: x.name, y: y.name, value: isMean ? `mean_${value.name}` : value.name });
    const { text, escaped } = biflag.SweepMap;
    const missing = this.swept.states.length - value.values.filter((v) => v !== null).length;
    const kinds = this.swept.kinds.map((kind, k) => {
      const count = rows.filter((row) => this.swept.states[row] === k).length;
      return count && k ? `${count} ${kind}${this.swept.isUnknown(k) && !isLines ? ", with a ring" : ""}` : "";
    });
    const phased = isLines ? 0 : rows.filter((row) => this.swept.isPhased(row)).length;
    const isDots = !isLines && !this.hasCells;
    const words = [
      value.about && `${value.label}: ${value.about}.`,
      `${rows.length} of ${this.swept.states.length} points${isDots ? ", a dot each" : ""}; ${missing} of the table without a value.`,
      isMean && `Where several points lie at one place, it shows their mean: ${rows.length} points at ${points.length} places.`,
      kinds.some(Boolean) && `Not steady${isLines ? ", with an empty mark" : ""}: ${kinds.filter(Boolean).join(", ")}.`,
      phased && `More than ${this.swept.mostSpreadDeg}° apart for other starting phases, with a ring: ${phased}.`,
      isLines && this.every > 1 && `A curve for one of every ${this.every} values of ${and}.`,
      !isLines && "The colours span the whole table.",
      this.contoured && `Contours every ${text(this.contoured)}, that of zero thicker; straight between neighbours.`,
    ];
    figure.querySelector("figcaption").innerHTML = words.filter(Boolean).map((sentence) => escaped(sentence)).join(" ");
  }

  /** An axis: where a value lies, its ticks, and the size of its cells. */
  static axis(column, isGrid, from, to, spacing) {
    const [low, high] = biflag.SweepMap.range(column.values);
    // Cells are even, whatever the spacing of the values; dots are where their values are.
    const cell = isGrid ? (to - from) / column.steps.length : 0;
    const place = isGrid
      ? (v) => from + (column.steps.findIndex((step) => step.from === v) + 0.5) * cell
      : (v) => from + (0.03 + (0.94 * (v - low)) / (high - low || 1)) * (to - from);
    const all = isGrid ? column.steps.map((step) => step.from) : biflag.SweepMap.round(low, high, Math.abs(to - from) / (3 * spacing));
    const every = isGrid ? Math.ceil((all.length * spacing) / Math.abs(to - from)) : 1;
    // Zero is among the ticks if it is on the axis.
    const zero = Math.max(all.indexOf(0), 0);
    return { place, ticks: all.filter((_, i) => i % every === zero % every), cell: Math.abs(cell) };
  }

  /** Where the drawing begins: beside the words of its vertical axis and the longest tick. */
  static leftOf(ticks) {
    return 29 + 6.6 * Math.max(5, ...ticks.map((v) => biflag.SweepMap.text(v).length));
  }

  map(box, x, y, value, points) {
    const { text, mix, VIRIDIS, DIVERGING, axis, leftOf } = biflag.SweepMap;
    const { width, height, top, right, bottom } = box;
    this.hasCells = this.swept.isGrid(x, y, points.length);
    const up = axis(y, this.hasCells, height - bottom, top, 16);
    const left = (box.left = leftOf(up.ticks));
    const across = axis(x, this.hasCells, left, width - right, 40);
    // The scale is that of the whole table, so that the sliders do not change it.
    const [least, most] = biflag.SweepMap.range(value.values);
    const isSigned = least < 0 && most > 0;
    const end = Math.max(-least, most);
    const [low, high] = isSigned ? [-end, end] : [least, most];
    const colour = (v) => mix(isSigned ? DIVERGING : VIRIDIS, (v - low) / (high - low || 1));
    // Dots cover a third of the map at most.
    const radius = Math.min(Math.max(Math.sqrt(((width - left - right) * (height - top - bottom)) / (9 * points.length)), 1.5), 6);
    const marks = points.map((point) => {
      const [cx, cy] = [across.place(point.a), up.place(point.b)];
      const shape = this.hasCells
        ? `rect x="${(cx - across.cell / 2).toFixed(1)}" y="${(cy - up.cell / 2).toFixed(1)}" width="${across.cell.toFixed(1)}" height="${up.cell.toFixed(1)}"`
        : `circle class="dot" cx="${cx.toFixed(1)}" cy="${cy.toFixed(1)}" r="${radius.toFixed(1)}"`;
      return `<${shape} data-at="${point.a},${point.b},${point.v}" fill="${colour(point.v)}">${this.words(point)}</${this.hasCells ? "rect" : "circle"}>`;
    });
    const odd = points.filter(({ isOdd }) => isOdd).map(({ a, b }) => `<circle class="odd" cx="${across.place(a).toFixed(1)}" cy="${up.place(b).toFixed(1)}" r="2.2"></circle>`);
    this.contoured = 0;
    const contours = this.hasCells ? this.contours(x, y, points, across, up, box) : "";
    const scale = Array.from({ length: 50 }, (_, i) => {
      const step = (height - bottom - top) / 50;
      const v = low + ((i + 0.5) / 50) * (high - low);
      return `<rect x="${width - right + 18}" y="${(height - bottom - (i + 1) * step).toFixed(1)}" width="12" height="${(step + 0.5).toFixed(1)}" fill="${colour(v)}"></rect>`;
    });
    const ends = [0, 0.5, 1].map((share) => `<text x="${width - right + 34}" y="${height - bottom - share * (height - bottom - top - 9)}">${text(low + share * (high - low))}</text>`);
    return [...marks, contours, ...odd, this.frame(box, x.label, y.label, across, up), ...scale, ...ends].join("");
  }

  /** Contours at round values over the nodes of a grid, straight between neighbours; the one of zero is thicker. */
  contours(x, y, points, across, up, { width, left, right }) {
    const { text, range, round } = biflag.SweepMap;
    const [columns, lines] = [x.steps.length, y.steps.length];
    if (Math.min(columns, lines) < this.swept.contourNodes) return "";
    const at = new Map(points.map(({ a, b, v }) => [`${a},${b}`, v]));
    const node = (i, k) => at.get(`${x.steps[i].from},${y.steps[k].from}`);
    const [low, high] = range(points.map(({ v }) => v));
    const levels = round(low, high, 8).filter((level) => level > low && level < high);
    if (levels.length < 2) return "";
    this.contoured = levels[1] - levels[0];
    /** Places of the labels so far, which may not cover each other. */
    const labels = [];
    const isFree = ([x0, y0]) => x0 > left + 30 && x0 < width - right - 30 && labels.every(([x1, y1]) => Math.abs(x1 - x0) > 34 || Math.abs(y1 - y0) > 13);
    const point = (i, k) => [across.place(x.steps[i].from), up.place(y.steps[k].from)];
    const drawn = levels.map((level) => {
      const segments = [];
      for (let i = 0; i + 1 < columns; i++) {
        for (let k = 0; k + 1 < lines; k++) {
          const corners = [[i, k], [i + 1, k], [i + 1, k + 1], [i, k + 1]];
          const values = corners.map(([a, b]) => node(a, b));
          if (values.includes(undefined)) continue;
          const crossings = [];
          corners.forEach((corner, n) => {
            const [a, b] = [values[n], values[(n + 1) % 4]];
            if (a < level === b < level) return;
            const share = (level - a) / (b - a);
            const [p, q] = [point(...corner), point(...corners[(n + 1) % 4])];
            crossings.push([p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1])]);
          });
          // A saddle has four: its mean tells which pairs belong together.
          if (crossings.length === 4 && values[0] < level === values.reduce((sum, v) => sum + v / 4, 0) < level) crossings.push(crossings.shift());
          for (let n = 0; n + 1 < crossings.length; n += 2) segments.push([crossings[n], crossings[n + 1]]);
        }
      }
      const path = segments.map(([[x0, y0], [x1, y1]]) => `M${x0.toFixed(1)} ${y0.toFixed(1)}L${x1.toFixed(1)} ${y1.toFixed(1)}`).join("");
      const label = segments.map(([start]) => start).find(isFree);
      if (label) labels.push(label);
      const words = label ? `<text class="level" x="${label[0].toFixed(1)}" y="${(label[1] - 3).toFixed(1)}" text-anchor="middle">${text(level)}</text>` : "";
      return path ? `<path class="contour${level === 0 ? " zero" : ""}" d="${path}"></path>${words}` : "";
    });
    return drawn.join("");
  }

  /** The result over the first input, a curve for each value of the second. */
  lines(box, x, y, value, points) {
    const { text, range, round, leftOf, CURVES, MOST_CURVES } = biflag.SweepMap;
    const { width, height, top, right, bottom } = box;
    this.contoured = 0;
    const isGrid = !y.isScattered;
    this.every = isGrid ? Math.ceil(y.steps.length / MOST_CURVES) : 1;
    // Dots have no dashes: fifths of scattered points have a colour each.
    const each = isGrid ? 1 : 2;
    const firsts = [...y.steps.keys()].filter((i) => i % (this.every * each) === 0);
    const groups = firsts.map((i) => ({
      from: y.steps[i].from,
      to: y.steps[i + each - 1].to,
      points: points.filter(({ step }) => step >= i && step < i + each).sort((p, q) => p.a - q.a),
    })).filter((group) => group.points.length);
    const name = ({ from, to }) => (isGrid ? text(from) : `${text(from)} to ${text(to)}`);
    const perName = 36 + 6.6 * Math.max(8, ...groups.map((group) => name(group).length));
    const perRow = Math.max(Math.floor((width - 62) / perName), 1);
    const room = 15 * Math.ceil(groups.length / perRow);
    const [xs, ys] = [range(points.map(({ a }) => a)), range(groups.flatMap((group) => group.points.map(({ v }) => v)))];
    const scale = ([low, high], from, to, spacing) => ({
      place: (v) => from + (0.03 + (0.94 * (v - low)) / (high - low || 1)) * (to - from),
      ticks: round(low, high, Math.abs(to - from) / spacing),
    });
    const up = scale(ys, height - bottom, top + room, 34);
    const left = (box.left = leftOf(up.ticks));
    const across = scale(xs, left, width - right, 60);
    const grid = up.ticks.map((v) => `<path class="empty" d="M${left} ${up.place(v).toFixed(1)}H${width - right}"></path>`);
    const curves = groups.map((group, n) => {
      const stroke = `#${CURVES[n % CURVES.length]}`;
      const dash = n < CURVES.length ? "" : ' stroke-dasharray="5 3"';
      const d = group.points.map(({ a, v }, i) => `${i ? "L" : "M"}${across.place(a).toFixed(1)} ${up.place(v).toFixed(1)}`).join("");
      const dots = group.points.map((point) => `<circle data-at="${point.a},${point.b},${point.v}" cx="${across.place(point.a).toFixed(1)}" cy="${up.place(point.v).toFixed(1)}" r="3" fill="${point.state > 0 ? "none" : stroke}" style="stroke:${stroke};stroke-width:1.5">${this.words(point)}</circle>`);
      const [kx, ky] = [62 + perName * (n % perRow), top + 15 * Math.floor(n / perRow)];
      const curve = isGrid ? `<path d="${d}" fill="none" stroke="${stroke}" stroke-width="1.8"${dash}></path>` : "";
      const key = isGrid ? `<path d="M${kx} ${ky}h20" stroke="${stroke}" stroke-width="2.5"${dash}></path>` : `<circle cx="${kx + 15}" cy="${ky}" r="3" fill="${stroke}"></circle>`;
      return `${curve}${dots.join("")}${key}<text x="${kx + 25}" y="${ky + 4}">${name(group)}</text>`;
    });
    return [...grid, ...curves, this.frame({ ...box, top: top + room }, x.label, value.label, across, up)].join("");
  }

  /** The frame, the ticks and the words of both axes. */
  frame({ width, height, left, top, right, bottom }, xLabel, yLabel, across, up) {
    const { text, escaped } = biflag.SweepMap;
    return [
      `<path class="empty" d="M${left} ${top}H${width - right}V${height - bottom}H${left}Z"></path>`,
      ...across.ticks.map((v) => `<text x="${across.place(v).toFixed(1)}" y="${height - bottom + 16}" text-anchor="middle">${text(v)}</text>`),
      ...up.ticks.map((v) => `<text x="${left - 6}" y="${(up.place(v) + 4).toFixed(1)}" text-anchor="end">${text(v)}</text>`),
      `<text x="${(left + width - right) / 2}" y="${height - 10}" text-anchor="middle">${escaped(xLabel)}</text>`,
      `<text transform="translate(13 ${(top + height - bottom) / 2}) rotate(-90)" text-anchor="middle">${escaped(yLabel)}</text>`,
    ].join("");
  }
};

for (const element of document.querySelectorAll(".sweep")) new biflag.SweepMap(element);
