// The data of a trial: from text in the page to numbers, and a quantity at a time.
"use strict";

const biflag = {};

biflag.bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;

/** Numbers in 16 or 32 bits; `null` where there is none. */
biflag.numbers = (packed) => {
  if (packed.f32 !== undefined) return Array.from(new Float32Array(biflag.bytes(packed.f32)));
  const { from, step } = packed;
  return Array.from(new Uint16Array(biflag.bytes(packed.u16)), (n) => (n === 65535 ? null : from + step * n));
};

/** A table of the page: `time` and named columns. */
biflag.table = (packed) => {
  const table = {};
  for (const [name, column] of Object.entries(packed)) table[name] = biflag.numbers(column);
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

/** A number with a real minus sign; a dash where there is none. */
biflag.format = (value, decimals) => {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const text = Math.abs(value).toFixed(decimals);
  return value < 0 && Number(text) !== 0 ? "−" + text : text;
};

biflag.colour = (name) => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
