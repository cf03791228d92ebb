// A trial on the page: its data, the selected time, and everything that follows the time.
"use strict";

biflag.Trial = class {
  constructor(section) {
    this.section = section;
    this.id = section.id;
    this.data = JSON.parse(document.getElementById(section.dataset.data).textContent);
    this.tables = {
      attitude: biflag.table(this.data.attitude),
      motors: biflag.table(this.data.motors),
    };
    if (this.data.forces) this.tables.forces = biflag.table(this.data.forces);
    if (this.data.link) {
      const { width_s: width, ...bars } = this.data.link;
      this.tables.link = { time: bars.received.map((_, i) => i * width), ...bars };
    }
    this.end = this.data.end_s;
    const run = this.data.phases.find(([name]) => name === "run");
    // The attitude is steady at the end of the run, before the next phase.
    this.time = run ? Math.max(run[1], run[2] - 0.01) : this.end;
    this.fresh = true;
    /** The curves that the legend hides. */
    this.hidden = new Set();
    this.find();
    this.scene = new biflag.Scene(section.querySelector(".scene canvas"), this);
    this.charts = [...section.querySelectorAll("[data-chart]")].map((place) => new biflag.Chart(place, place.dataset.chart, this));
    biflag.Address.restore(this);
    new ResizeObserver(() => this.resize()).observe(section.querySelector(".charts"));
    this.show();
  }

  find() {
    const one = (selector) => this.section.querySelector(selector);
    [this.button, this.slider, this.rate] = [one(".play"), one(".scrub"), one(".rate")];
    this.outputs = [...this.section.querySelectorAll("[data-out]")];
    this.slider.max = this.end;
    this.button.addEventListener("click", () => this.toggle());
    this.slider.addEventListener("input", () => this.seek(Number(this.slider.value)));
    for (const [selector, act] of Object.entries({
      ".view-in": () => this.scene.zoom(1.2),
      ".view-out": () => this.scene.zoom(1 / 1.2),
      ".zoom-in": () => this.zoomBy(0.5),
      ".zoom-out": () => this.zoomBy(2),
      ".zoom-all": () => this.zoom(null),
    })) one(selector).addEventListener("click", act);
    const each = (selector, act) => this.section.querySelectorAll(selector).forEach((element) => element.addEventListener("click", () => act(element)));
    each("[data-look]", (button) => this.scene.look(button.dataset.look));
    each("[data-show]", (button) => this.toggleSolid(button.dataset.show));
    each("[data-camera]", (button) => this.moveCamera(button.dataset.camera));
    each("[data-curve]", (button) => this.toggleCurve(button.dataset.curve));
    biflag.addSaveButtons(this.section, this);
    for (const link of this.section.querySelectorAll("[data-seek]")) link.addEventListener("click", () => this.seek(Number(link.dataset.seek)));
  }

  /** Lets the camera follow or fly, or stand still again. */
  moveCamera(name) {
    this.scene.move(name);
    this.pressed();
  }

  /** Shows or hides the ghost, the forces or the trails. */
  toggleSolid(name) {
    this.scene.shown[name] = !this.scene.shown[name];
    this.pressed();
    this.changed();
  }

  /** Shows or hides a curve in all charts that have it. */
  toggleCurve(key) {
    if (!this.hidden.delete(key)) this.hidden.add(key);
    this.pressed();
    for (const chart of this.charts) chart.build();
    this.changed();
  }

  /** Puts the buttons of legends and views into the state of what they show. */
  pressed() {
    const press = (selector, is) => this.section.querySelectorAll(selector).forEach((button) => button.setAttribute("aria-pressed", is(button)));
    press("[data-curve]", (button) => !this.hidden.has(button.dataset.curve));
    press("[data-show]", (button) => this.scene.shown[button.dataset.show]);
    press("[data-camera]", (button) => this.scene.camera === button.dataset.camera);
  }

  /** After the view has changed: draws it, and puts it into the page's address. */
  changed() {
    this.scene.draw(this.time);
    biflag.Address.keep(this);
  }

  /** Plays from a second before the run. */
  begin() {
    const run = this.data.phases.find(([name]) => name === "run");
    this.time = run ? Math.max(0, run[1] - 1) : 0;
    this.fresh = false;
    this.toggle();
  }

  toggle() {
    this.playing = !this.playing;
    if (this.playing) {
      if (this.fresh || this.time >= this.end) this.time = 0;
      this.fresh = false;
      this.last = null;
      requestAnimationFrame((now) => this.step(now));
    } else {
      biflag.Address.keep(this);
      this.scene.draw(this.time);
    }
    this.button.classList.toggle("playing", this.playing);
    this.button.setAttribute("aria-label", this.playing ? "Pause" : "Play");
  }

  step(now) {
    if (!this.playing) return;
    if (this.last !== null) {
      const passed_s = (now - this.last) / 1000;
      this.time = Math.min(this.time + passed_s * Number(this.rate.value), this.end);
      if (!matchMedia("(prefers-reduced-motion: reduce)").matches) this.scene.flown_s += passed_s;
    }
    this.last = now;
    this.show();
    if (this.time >= this.end) this.toggle();
    else requestAnimationFrame((next) => this.step(next));
  }

  seek(time) {
    this.fresh = false;
    this.time = Math.min(Math.max(time, 0), this.end);
    this.show();
    biflag.Address.keep(this);
  }

  /** Everything that follows the time. */
  show() {
    this.slider.value = this.time;
    this.scene.draw(this.time);
    for (const chart of this.charts) chart.point(this.time);
    this.read(this.time);
  }

  /** The values at a time: the selected one, or the one under the pointer. */
  read(time) {
    biflag.readOut(this, time, 2);
    const [yaw, pitch, roll] = ["yaw", "pitch", "roll"].map((name) => biflag.format(biflag.valueAt(this, "attitude", name, time), 1));
    this.slider.setAttribute("aria-valuetext", `${time.toFixed(1)} seconds: yaw ${yaw}, pitch ${pitch}, roll ${roll} degrees`);
  }

  hover(time) {
    if (!this.playing && this.charts) this.read(time ?? this.time);
  }

  /** The range of time that the charts show; `null`: the whole trial. */
  zoom(range) {
    this.range = range && range[1] - range[0] > 0.02 ? [Math.max(0, range[0]), Math.min(this.end, range[1])] : null;
    for (const chart of this.charts) {
      chart.zoom(this.range);
      chart.plot.setSelect({ left: 0, width: 0 }, false);
    }
    biflag.Address.keep(this);
    queueMicrotask(() => this.charts.forEach((chart) => chart.point(this.time)));
  }

  zoomBy(factor) {
    const [from, to] = this.range ?? [0, this.end];
    const half = ((to - from) / 2) * factor;
    const middle = Math.min(Math.max(this.time, half), Math.max(this.end - half, half));
    this.zoom(2 * half >= this.end ? null : [middle - half, middle + half]);
  }

  resize() {
    for (const chart of this.charts) chart.resize();
    this.scene.draw(this.time);
  }

  /** Draws everything in the present colours. */
  repaint() {
    for (const chart of this.charts) chart.build();
    this.scene.paint();
    this.scene.draw(this.time);
  }
};
