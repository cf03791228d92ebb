// The data of a trial: decodes it, and finds the value of a quantity at a time.
"use strict";

const biflag = {};

biflag.bytes = (text) => {
  const letters = atob(text);
  const bytes = new Uint8Array(letters.length);
  // A loop, because a function for each letter takes a tenth of a second more to open a page.
  for (let i = 0; i < letters.length; i++) bytes[i] = letters.charCodeAt(i);
  return bytes.buffer;
};

/** Numbers in 16 or 32 bits, or evenly spaced ones; `null` for a missing value. */
biflag.numbers = (packed) => {
  if (packed.count !== undefined) return Array.from({ length: packed.count }, (_, i) => packed.from + i * packed.step);
  if (packed.f32 !== undefined) return Array.from(new Float32Array(biflag.bytes(packed.f32)));
  const { from, step } = packed;
  return Array.from(new Uint16Array(biflag.bytes(packed.u16)), (n) => (n === 65535 ? null : from + step * n));
};

/** A table of the page: `time` and named columns; with `ranges`, the stretches that its charts show. */
biflag.table = (packed) => {
  const { ranges, ...columns } = packed;
  const table = {};
  for (const [name, column] of Object.entries(columns)) table[name] = biflag.numbers(column);
  if (ranges) table.ranges = biflag.ranges(ranges);
  return table;
};

/** The mean of each quantity in each stretch under the quantity's name, its range as `_low` and `_high`. */
biflag.ranges = ({ from_s: from, width_s: width, count, columns }) => {
  const table = { time: Array.from({ length: count }, (_, i) => from + (i + 0.5) * width), width };
  for (const [name, { mean, low, high }] of Object.entries(columns)) {
    table[name] = biflag.numbers(mean);
    if (!low) continue;
    table[name + "_low"] = biflag.numbers(low);
    table[name + "_high"] = biflag.numbers(high);
  }
  return table;
};

/** The index of the last time that is not after `t`; 0 before the first. */
biflag.before = (time, t) => {
  let low = 0;
  let high = time.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (time[middle] <= t) low = middle;
    else high = middle - 1;
  }
  return low;
};

/** The value at a time, on the straight line between its neighbours; `null` in a gap. */
biflag.at = (time, column, t) => {
  if (!column || time.length === 0) return null;
  const i = biflag.before(time, t);
  const a = column[i];
  if (i + 1 >= time.length || t <= time[i]) return a;
  const b = column[i + 1];
  if (a === null || b === null) return null;
  return a + ((b - a) * (t - time[i])) / (time[i + 1] - time[i] || 1);
};

/** The value of a column of a trial's table at a time. */
biflag.valueAt = (trial, table, column, time) => biflag.at(trial.tables[table].time, trial.tables[table][column], time);

/** Writes the values at a time into the outputs of a trial: each names a table, a column and the decimals. */
biflag.readOut = (trial, time, timeDecimals) => {
  for (const output of trial.outputs) {
    const [table, column, decimals] = output.dataset.out.split(" ");
    if (table === "time") output.textContent = `${time.toFixed(timeDecimals)} s`;
    else if (table === "phase") output.textContent = trial.data.phases.findLast(([, from]) => from <= time + 1e-6)?.[0] ?? "–";
    else output.textContent = biflag.format(biflag.valueAt(trial, table, column, time), Number(decimals));
  }
};

/** A number with a proper minus sign; a dash for a missing value. */
biflag.format = (value, decimals) => {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const text = Math.abs(value).toFixed(decimals);
  return value < 0 && Number(text) !== 0 ? "−" + text : text;
};

biflag.colour = (name) => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
