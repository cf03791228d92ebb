// A robot that moves: its data, the selected time, and the clock that moves it on.
"use strict";

biflag.Player = class {
  /** `element` has a canvas and a button to play, and names the element with the data. */
  constructor(element) {
    this.data = JSON.parse(document.getElementById(element.dataset.data).textContent);
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
    // The attitude is steady at the end of the run, before the next phase.
    this.time = this.run ? Math.max(this.run[1], this.run[2] - 0.01) : this.end;
    this.fresh = true;
    this.rate = 1;
    this.button = element.querySelector(".play");
    this.button.addEventListener("click", () => this.toggle());
    this.scene = new biflag.Scene(element.querySelector("canvas.view3d"), this);
  }

  /** Name, start and end of the run, if the trial has one. */
  get run() {
    return this.data.phases.find(([name]) => name === "run");
  }

  /** Plays from a second before the run. */
  begin() {
    this.time = this.run ? Math.max(0, this.run[1] - 1) : 0;
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
      this.film?.stop();
      this.changed();
    }
    this.button.classList.toggle("playing", this.playing);
    this.button.setAttribute("aria-label", this.playing ? "Pause" : "Play");
  }

  step(now) {
    if (!this.playing) return;
    if (this.last !== null) {
      const passed_s = (now - this.last) / 1000;
      this.time = Math.min(this.time + passed_s * this.rate, this.end);
      if (!matchMedia("(prefers-reduced-motion: reduce)").matches) this.scene.flown_s += passed_s;
    }
    this.last = now;
    this.show();
    if (this.time >= this.end) this.toggle();
    else requestAnimationFrame((next) => this.step(next));
  }

  /** Everything that follows the time. */
  show() {
    this.scene.draw(this.time);
  }

  /** After the view has changed. */
  changed() {
    this.scene.draw(this.time);
  }

  /** Draws everything in the present colours. */
  repaint() {
    this.scene.paint();
    this.scene.draw(this.time);
  }
};
