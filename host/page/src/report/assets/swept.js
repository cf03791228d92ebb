// The table of a sweep: its columns, and how its points lie over two inputs, on a grid or scattered.
"use strict";

biflag.Swept = class {
  /** More distinct values than this make no cells, and no steps of a slider: these become tenths of the points. */
  static MOST_STEPS = 60;
  /** Fewer values are steps, however they are distributed. */
  static FEW_STEPS = 12;
  /** The number of points from which the axes are chosen. */
  static SAMPLE = 2000;
  /** The smallest number of places that make a map of cells worth opening on. */
  static LEAST_CELLS = 9;

  constructor({ inputs, results, states, kinds, limits }) {
    // Numbers of 32 bits have seven digits.
    const value = (v) => (Number.isNaN(v) ? null : Number(v.toPrecision(7)));
    const column = (packed) => ({ ...packed, values: biflag.numbers(packed.values).map(value) });
    this.inputs = inputs.map(column);
    this.results = results.map(column);
    /** The index in `kinds` of the motion of each point, -1 where the table has none. */
    [this.states, this.kinds] = [states, kinds];
    /** The largest difference of angles between starting phases without a mark, and the least values of inputs for contours. */
    [this.mostSpreadDeg, this.contourNodes] = [limits.most_spread_deg, limits.contour_nodes];
    this.spreads = this.results.filter(({ name }) => ["yaw_spread_deg", "tilt_spread_deg"].includes(name));
    this.rows = [...states.keys()];
    const every = Math.ceil(states.length / biflag.Swept.SAMPLE);
    this.sample = this.rows.filter((row) => row % every === 0);
    for (const input of this.inputs) this.step(input);
  }

  isUnknown(state) {
    return ["not found", "overturned"].includes(this.kinds[state]);
  }

  /** Whether the angles of a row depend on the starting phase of the flagella. */
  isPhased(row) {
    return this.spreads.some(({ values }) => values[row] > this.mostSpreadDeg);
  }

  static distinct(values) {
    return [...new Set(values)].filter((value) => value !== null).sort((a, b) => a - b);
  }

  /** Gives an input its steps, each distinct value or tenths of scattered ones as ranges, and each row the index of its step. */
  step(input) {
    const sorted = biflag.Swept.distinct(input.values);
    input.isScattered = sorted.length > biflag.Swept.MOST_STEPS || (sorted.length > biflag.Swept.FEW_STEPS && this.isOfDesign(input, sorted.length));
    if (input.isScattered) {
      const at = (share) => sorted[Math.min(Math.floor(share * sorted.length), sorted.length - 1)];
      input.steps = Array.from({ length: 10 }, (_, i) => ({ from: at(i / 10), to: at((i + 1) / 10) }));
    } else {
      input.steps = sorted.map((value) => ({ from: value, to: value }));
    }
    const indices = new Map(sorted.map((value) => [value, input.steps.findIndex(({ to }) => value <= to)]));
    input.stepOf = input.values.map((value) => indices.get(value) ?? null);
  }

  /** Whether all values of an input are about as frequent, and meet less than half of another input's values: a Sobol sequence. */
  isOfDesign(input, count) {
    const counts = new Map();
    for (const value of input.values) counts.set(value, (counts.get(value) ?? 0) + 1);
    const isEven = Math.max(...counts.values()) * count <= 2 * this.rows.length;
    const meets = (other) => this.places(input, other, this.rows) / biflag.Swept.distinct(other.values).length;
    return isEven && this.inputs.some((other) => other !== input && 2 * meets(other) < count);
  }

  /** Returns the number of distinct places of rows over two inputs. */
  places(x, y, rows) {
    return new Set(rows.map((row) => `${x.values[row]},${y.values[row]}`)).size;
  }

  /** Returns whether so many places fill a grid of both inputs, so that they are cells. */
  isGrid(x, y, places) {
    const [columns, lines] = [x.steps.length, y.steps.length];
    return !x.isScattered && !y.isScattered && columns > 1 && lines > 1 && 2 * places >= columns * lines;
  }

  /** Returns the inputs to open on: the largest grid, or the points that spread most over both; of equal ones those on which the
   * first result depends most. */
  bestAxes() {
    const explained = new Map(this.inputs.map((input) => [input, this.explained(input)]));
    const rank = ([x, y]) => {
      const shown = this.usual(x, y, this.sample).rows;
      const places = this.places(x, y, shown);
      if (this.isGrid(x, y, places) && places >= biflag.Swept.LEAST_CELLS) return [Infinity, places, 0];
      const values = [x, y].map((input) => new Set(shown.map((row) => input.values[row])).size);
      return [Math.min(...values), places, explained.get(x) + explained.get(y)];
    };
    const pairs = this.inputs.flatMap((x, i) => this.inputs.slice(i + 1).map((y) => ({ axes: [x, y], rank: rank([x, y]) })));
    const better = (a, b) => Math.sign(a[0] - b[0]) || a[1] - b[1] || a[2] - b[2];
    return pairs.reduce((best, other) => (better(other.rank, best.rank) > 0 ? other : best)).axes;
  }

  /** Returns the variance of the means of the first result over the steps of an input, as a share of its variance. */
  explained(input) {
    const values = this.results[0].values;
    const spread = (rows) => {
      const mean = rows.reduce((sum, row) => sum + values[row], 0) / rows.length;
      return rows.reduce((sum, row) => sum + (values[row] - mean) ** 2, 0);
    };
    const known = this.sample.filter((row) => values[row] !== null);
    const within = input.steps.map((_, step) => spread(known.filter((row) => input.stepOf[row] === step)));
    return 1 - within.reduce((sum, part) => sum + part, 0) / (spread(known) || 1);
  }

  /** Returns the step that most of these rows have, the middle one of equals: in a sweep of one input at a time, that of the robot
   * itself. */
  static commonest({ steps, stepOf }, rows) {
    const counts = steps.map(() => 0);
    for (const row of rows) if (stepOf[row] !== null) counts[stepOf[row]] += 1;
    const most = Math.max(...counts);
    const best = [...steps.keys()].filter((step) => counts[step] === most);
    return best[best.length >> 1];
  }

  /** Returns the step of each input that is no axis, and the rows with these steps. It is the commonest step if that leaves half of
   * the places, else all, which is -1. */
  usual(x, y, rows) {
    const steps = this.inputs.filter((input) => input !== x && input !== y).map((input) => {
      const commonest = biflag.Swept.commonest(input, rows);
      const fixed = rows.filter((row) => input.stepOf[row] === commonest);
      const isFixed = 2 * this.places(x, y, fixed) >= this.places(x, y, rows);
      if (isFixed) rows = fixed;
      return [input, isFixed ? commonest : -1];
    });
    return { steps: new Map(steps), rows };
  }
};
