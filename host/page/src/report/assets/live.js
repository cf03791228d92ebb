// The page of a recording that runs: asks the program for news, and follows the robot.
"use strict";

/** Milliseconds from one question to the next. */
const ASKS_EVERY = 250;
/** The page shows what came this long ago, so that the robot moves evenly between two answers. */
const BEHIND_S = 0.4;

biflag.LiveTrial = class {
  constructor(section) {
    this.section = section;
    this.id = section.id;
    this.data = JSON.parse(document.getElementById(section.dataset.data).textContent);
    this.hidden = new Set();
    this.number = 0;
    this.playing = true;
    this.clear();
    this.scene = new biflag.Scene(section.querySelector(".scene canvas"), this);
    this.scene.robots[0].turns = this.turns;
    this.charts = [...section.querySelectorAll("[data-chart]")].map((place) => new biflag.Chart(place, place.dataset.chart, this));
    this.ribbon = new biflag.Ribbon(section.querySelector("[data-ribbon]"), this);
    this.outputs = [...section.querySelectorAll("[data-out]")];
    for (const button of section.querySelectorAll("[data-look]")) button.addEventListener("click", () => this.scene.look(button.dataset.look));
    section.querySelector(".view-in").addEventListener("click", () => this.scene.zoom(1.2));
    section.querySelector(".view-out").addEventListener("click", () => this.scene.zoom(1 / 1.2));
    for (const button of section.querySelectorAll("[data-curve]")) button.addEventListener("click", () => this.toggleCurve(button));
    new ResizeObserver(() => this.resize()).observe(section.querySelector(".charts"));
    requestAnimationFrame(() => this.step());
  }

  /** Forgets the trial before. The scene and the charts keep these tables and see what is added to them. */
  clear() {
    this.tables ??= { attitude: { time: [], yaw: [], pitch: [], roll: [] }, motors: { time: [], speed1: [], speed2: [], target1: [], target2: [] } };
    this.turns ??= { time: [], one: [], two: [] };
    for (const table of [...Object.values(this.tables), this.turns]) for (const column of Object.values(table)) column.length = 0;
    [this.data.phases, this.data.marks] = [[], []];
    [this.time, this.end, this.zero] = [0, 1, 0];
  }

  /** Takes over an answer of the program. */
  take({ trial, from, rows }) {
    if (trial.number !== this.number || from === 0) this.clear();
    this.number = trial.number;
    const { attitude, motors } = this.tables;
    // The yaw counts from the start of the run once that is known.
    if (trial.zero_deg !== this.zero) attitude.yaw.forEach((yaw, i) => (attitude.yaw[i] = yaw + this.zero - trial.zero_deg));
    this.zero = trial.zero_deg;
    for (const [time, yaw, pitch, roll, speed1, speed2, target1, target2, one, two] of rows) {
      const add = (table, values) => Object.values(table).forEach((column, i) => column.push(values[i]));
      add(attitude, [time, yaw - this.zero, pitch, roll]);
      add(motors, [time, speed1, speed2, target1, target2]);
      add(this.turns, [time, one, two]);
    }
    const last = attitude.time.at(-1) ?? 0;
    this.end = Math.max(trial.planned_s, last, 1);
    this.data.phases = trial.phases.map(([name, begins], i) => [name, begins, trial.phases[i + 1]?.[1] ?? last]).filter(([name]) => name !== "end");
    this.data.marks = trial.marks;
    if (!rows.length) return;
    this.charts.forEach((chart) => chart.grow());
    this.ribbon.build();
  }

  /** Moves the robot on with the clock, up to the last row. */
  step(now = performance.now()) {
    const last = this.tables.attitude.time.at(-1) ?? 0;
    const passed = this.last === undefined ? 0 : (now - this.last) / 1000;
    this.last = now;
    // An emulated board may run faster than the clock.
    const pace = last - this.time > 2 * BEHIND_S ? (last - this.time) / BEHIND_S : 1;
    this.time = Math.min(this.time + pace * passed, last);
    if (!document.hidden) this.show();
    requestAnimationFrame((next) => this.step(next));
  }

  show() {
    this.scene.draw(this.time);
    for (const chart of [this.ribbon, ...this.charts]) chart.point(this.time);
    biflag.readOut(this, this.time, 1);
  }

  toggleCurve(button) {
    const key = button.dataset.curve;
    if (!this.hidden.delete(key)) this.hidden.add(key);
    button.setAttribute("aria-pressed", !this.hidden.has(key));
    for (const chart of this.charts) chart.build();
  }

  resize() {
    for (const chart of this.charts) chart.resize();
    this.ribbon.build();
  }

  /** What the scene and the charts of a recorded trial also ask for. */
  changed() {
    this.scene.draw(this.time);
  }
  hover() {}
  seek() {}
  toggle() {}
  zoom() {}
};

{
  const one = (selector) => document.querySelector(selector);
  const section = one("section.trial");
  const trial = new biflag.LiveTrial(section);
  const say = (text, isOver = false) => {
    one(".now").textContent = text;
    document.body.classList.toggle("over", isOver);
  };

  const cell = (text, kind) => Object.assign(document.createElement("td"), { textContent: text, className: kind ?? "" });
  /** The table of the session: its rows are texts, its maps come from the program. */
  const show = ({ rows, maps }) => {
    one("#trials tbody").replaceChildren(...rows.map(({ name, state, cells, notes }) => {
      const row = document.createElement("tr");
      row.className = state === "running" ? "open" : "";
      row.append(cell(name), ...cells.map((text) => cell(text.replace("-", "−"))), cell(notes || (state === "done" ? "" : state), "text"));
      return row;
    }));
    one(".maps").innerHTML = maps;
  };

  let shown = "";
  /** Answers that failed, one after the other: a computer that was asleep loses some. */
  let failed = 0;
  const ask = async () => {
    let news;
    try {
      const answer = await fetch(`news?trial=${trial.number}&have=${trial.tables.attitude.time.length}`);
      news = await answer.json();
      failed = 0;
    } catch {
      failed += 1;
      if (failed < 8) return setTimeout(ask, ASKS_EVERY);
      return say("The program does not answer: it has ended, or this computer is busy. Reload to ask again.", true);
    }
    trial.take(news);
    one("h1").textContent = news.trial.name || section.dataset.waiting;
    if (news.session && JSON.stringify(news.session) !== shown) {
      shown = JSON.stringify(news.session);
      show(news.session);
    }
    document.documentElement.dataset.ready = "yes";
    if (news.ended !== null) return say(news.ended, true);
    setTimeout(ask, ASKS_EVERY);
  };

  one(".stop").addEventListener("click", async () => {
    say("Stopping the motors …");
    one(".stop").disabled = true;
    try {
      await fetch("stop", { method: "POST" });
    } catch {
      say("The program did not hear it: press Ctrl-C in the terminal, or unplug the motors.");
      one(".stop").disabled = false;
    }
  });
  one(".note").addEventListener("change", async ({ target }) => {
    // What the program did not hear stays in the field.
    const { ok } = await fetch("note", { method: "POST", body: target.value }).catch(() => ({ ok: false }));
    if (ok) target.value = "";
  });
  const repaint = () => {
    trial.scene.paint();
    trial.charts.forEach((chart) => chart.build());
    trial.ribbon.build();
    trial.show();
  };
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);
  const paper = (on) => {
    document.documentElement.classList.toggle("paper", on);
    repaint();
  };
  addEventListener("beforeprint", () => paper(true));
  addEventListener("afterprint", () => paper(false));
  ask();
}
