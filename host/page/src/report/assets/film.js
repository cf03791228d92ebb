// Films the view of the robot as WebM, with the browser's own encoder.
"use strict";

/** Bits of a second of film. */
const FILM_BITS = 8e6;

biflag.Film = class {
  static TYPE = "video/webm";

  static get works() {
    return "MediaRecorder" in window && "captureStream" in HTMLCanvasElement.prototype && MediaRecorder.isTypeSupported(this.TYPE);
  }

  /** Gives the view of a trial its button, where the browser can film. */
  static addButton(section, trial) {
    if (!this.works) return;
    const button = Object.assign(document.createElement("button"), { type: "button", className: "film" });
    this.say(button, false);
    button.addEventListener("click", () => (trial.film ? trial.toggle() : new this(trial, button)));
    section.querySelector(".scene .save").append(button);
  }

  static say(button, isFilming) {
    button.textContent = isFilming ? "■ Stop" : "WEBM";
    button.ariaLabel = isFilming ? "Stop filming, and save the film" : "Film the view from the selected time on, and save it as WebM";
  }

  /** Films a trial while it plays: until its end, until it is paused, or until the button is pressed again. */
  constructor(trial, button) {
    this.trial = trial;
    const canvas = trial.scene.canvas;
    // A film keeps its size.
    trial.scene.ratio = canvas.width / canvas.clientWidth;
    this.recorder = new MediaRecorder(canvas.captureStream(), { mimeType: biflag.Film.TYPE, videoBitsPerSecond: FILM_BITS });
    const parts = [];
    this.recorder.addEventListener("dataavailable", ({ data }) => parts.push(data));
    this.recorder.addEventListener("stop", () => {
      trial.scene.ratio = null;
      trial.film = null;
      biflag.Film.say(button, false);
      biflag.download(new Blob(parts, { type: biflag.Film.TYPE }), `${biflag.fileName("film")}.webm`);
    });
    trial.film = this;
    biflag.Film.say(button, true);
    this.recorder.start();
    if (!trial.playing) trial.toggle();
  }

  stop() {
    if (this.recorder.state !== "inactive") this.recorder.stop();
  }
};
