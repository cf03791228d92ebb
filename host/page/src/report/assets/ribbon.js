// The ribbon over the charts: the phases of the trial, when the flagella touch, and events with their names, over the same range
// of time as the charts, with a needle at the selected time. What a name has no room for is in the tip of its mark.
"use strict";

/** Kinds of events that have a name: the class of their colour and their sign, the most important first. */
const NAMED = {
  fault: ["c-bad", "▲"],
  lost: ["c-bad", "▲"],
  reversal: ["c-ink", "⇄"],
  contact: ["c-warn", "●"],
  warning: ["c-warn", "△"],
  note: ["c-ink", "✎"],
};

biflag.Ribbon = class {
  /** `element`: the place for the ribbon. `trial`: see player.js. */
  constructor(element, trial) {
    Object.assign(this, { element, trial, range: null });
    element.addEventListener("click", ({ clientX }) => {
      const { left, width } = element.getBoundingClientRect();
      const [from, to] = this.span;
      trial.seek(from + ((to - from) * (clientX - left)) / width);
    });
    this.build();
  }

  /** The time that the ribbon shows. */
  get span() {
    return this.range ?? [0, this.trial.end];
  }

  /** The place of a time, 0 to 1 within the ribbon. */
  place(time) {
    const [from, to] = this.span;
    return (time - from) / (to - from);
  }

  build() {
    const { phases, bundling = [], named, marks } = this.trial.data;
    const row = (name, blocks) => this.add(Object.assign(document.createElement("div"), { className: name }), blocks);
    const rows = [row("phases", phases.map(([name, from, to]) => ({ name, from, to, look: name, length: `${Math.round(10 * (to - from)) / 10} s` })))];
    const contact = bundling.map(([from, state], i) => ({ name: state, from, to: bundling[i + 1]?.[0] ?? this.trial.end, look: state }));
    if (contact.some(({ look }) => look !== "apart")) rows.push(row("contacts", contact.filter(({ look }) => look !== "apart")));
    this.needle = Object.assign(document.createElement("div"), { className: "needle" });
    this.element.replaceChildren(...rows, this.needle);
    const events = named ?? marks.filter(([, kind]) => NAMED[kind]);
    if (events.length) this.name(events);
    this.point(this.trial.time);
  }

  /** Fills a row with blocks. A block says its name where it has room, and how long it is where it has more. */
  add(row, blocks) {
    for (const { name, from, to, look, length } of blocks) {
      const [left, right] = [from, to].map((time) => Math.min(Math.max(this.place(time), 0), 1));
      if (right <= left) continue;
      const block = Object.assign(document.createElement("div"), { className: look, title: `${name}, ${from.toFixed(1)} to ${to.toFixed(1)} s` });
      const room = (right - left) * this.element.clientWidth;
      if (room > 6.5 * name.length + 5) block.append(name);
      if (length && room > 7 * (name.length + length.length) + 24) block.append(Object.assign(document.createElement("i"), { textContent: length }));
      Object.assign(block.style, { left: `${100 * left}%`, width: `${100 * (right - left)}%` });
      row.append(block);
    }
    return row;
  }

  /** Marks the events. The important ones get the room for their names first, beside all marks. */
  name(events) {
    const row = Object.assign(document.createElement("div"), { className: "events" });
    this.element.insertBefore(row, this.needle);
    const width = this.element.clientWidth;
    const write = (text, look, title) => row.appendChild(Object.assign(document.createElement("span"), { className: look, textContent: text, title }));
    const kinds = Object.keys(NAMED);
    const shown = events.map(([time, kind, text]) => ({ x: this.place(time) * width, kind, text, title: `${text}, ${time.toFixed(1)} s` }));
    const inside = shown.filter(({ x }) => x >= 0 && x <= width).sort((a, b) => kinds.indexOf(a.kind) - kinds.indexOf(b.kind));
    const taken = inside.map(({ x, kind, title }) => {
      const mark = write(NAMED[kind][1], NAMED[kind][0], title);
      mark.style.left = `${x - mark.offsetWidth / 2}px`;
      return [x - 7, x + 7];
    });
    for (const { x, kind, text, title } of inside) {
      const name = write(text, NAMED[kind][0], title);
      const long = Math.min(name.offsetWidth + 1, 0.6 * width);
      const isFree = (left) => left >= 0 && left + long <= width && taken.every(([from, to]) => left >= to || left + long <= from);
      const left = [x + 9, x - 9 - long].find(isFree);
      if (left === undefined) {
        name.remove();
        continue;
      }
      Object.assign(name.style, { left: `${left}px`, maxWidth: `${long}px` });
      taken.push([left - 6, left + long + 6]);
    }
  }

  zoom(range) {
    this.range = range;
    this.build();
  }

  /** Puts the needle at a time. */
  point(time) {
    const place = this.place(time);
    this.needle.hidden = !(place >= 0 && place <= 1);
    this.needle.style.left = `${100 * place}%`;
  }
};
