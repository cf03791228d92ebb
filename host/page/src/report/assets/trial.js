// A trial on the page: its charts, its values, and everything that follows the selected time.
"use strict";

biflag.Trial = class extends biflag.Player {
  constructor(section) {
    super(section);
    this.section = section;
    this.id = section.id;
    /** The curves that the legend hides. */
    this.hidden = new Set();
    this.find();
    this.charts = [...section.querySelectorAll("[data-chart]")].map((place) => new biflag.Chart(place, place.dataset.chart, this));
    this.ribbon = new biflag.Ribbon(section.querySelector("[data-ribbon]"), this);
    biflag.Address.restore(this);
    this.show();
    const charts = section.querySelector(".charts");
    let width = charts.clientWidth;
    // An observer also reports the size that it finds, in which all is drawn already.
    new ResizeObserver(() => {
      if (charts.clientWidth === width) return;
      width = charts.clientWidth;
      this.resize();
    }).observe(charts);
  }

  find() {
    const one = (selector) => this.section.querySelector(selector);
    [this.slider, this.rates] = [one(".scrub"), one(".rate")];
    this.outputs = [...this.section.querySelectorAll("[data-out]")];
    this.slider.max = this.end;
    const atRate = () => (this.rate = Number(this.rates.value));
    this.rates.addEventListener("change", atRate);
    // A browser that reloads keeps the choice.
    atRate();
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
    biflag.Film.addButton(this.section, this);
    biflag.roveIn(this.section);
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
    super.changed();
    biflag.Address.keep(this);
  }

  seek(time) {
    this.fresh = false;
    this.time = Math.min(Math.max(time, 0), this.end);
    this.show();
    biflag.Address.keep(this);
  }

  /** Everything that follows the time. */
  show() {
    super.show();
    this.slider.value = this.time;
    for (const chart of [this.ribbon, ...this.charts]) chart.point(this.time);
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
    this.ribbon.zoom(this.range);
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
    this.ribbon.build();
    this.scene.draw(this.time);
  }

  repaint() {
    for (const chart of [...this.charts, this.ribbon]) chart.build();
    super.repaint();
  }
};
