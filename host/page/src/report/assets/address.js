// The page's address names the view: the open trial, the selected time, the range of the charts, the hidden curves, and where
// the robot is seen from. A copied address opens the same view: `#trial-3&t=62.5&range=20,80&hide=truth&look=top`.
"use strict";

biflag.Address = class {
  /** Returns the id of the trial that the address names. */
  static section() {
    return location.hash.slice(1).split("&")[0];
  }

  /** Puts a trial's view into the address, once it has stopped changing. */
  static keep(trial) {
    if (trial.playing || !trial.charts) return;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => {
      // The address may name another trial that is about to open.
      const next = this.section();
      if (trial.section.hidden || (next !== trial.id && document.getElementById(`${next}-data`))) return;
      const { view, shown } = trial.scene;
      const short = (numbers) => numbers.map((number) => Number(number.toFixed(3))).join(",");
      const parts = { t: short([trial.time]) };
      if (trial.range) parts.range = short(trial.range);
      if (trial.hidden.size) parts.hide = [...trial.hidden].join(",");
      const off = Object.keys(shown).filter((name) => !shown[name]);
      if (off.length) parts.off = off.join(",");
      if (trial.scene.camera !== "still") parts.camera = trial.scene.camera;
      const same = (other) => Object.entries(other).every(([key, value]) => view[key] === value);
      const named = Object.entries(biflag.Scene.VIEWS).find(([, other]) => same(other));
      parts.look = named?.[0] ?? [short([view.azimuth, view.elevation, view.zoom]), ...["flat", "whole"].filter((flag) => view[flag])].join(",");
      const address = [trial.id, ...Object.entries(parts).map(([key, value]) => `${key}=${value}`)].join("&");
      try {
        history.replaceState(null, "", "#" + address);
      } catch {
        // A page inside another one, such as a notebook, may have no address of its own.
      }
    }, 150);
  }

  /** Gives a trial the view of the address, if that names the trial. */
  static restore(trial) {
    const [id, ...pairs] = location.hash.slice(1).split("&");
    if (id !== trial.id) return;
    const parts = Object.fromEntries(pairs.map((pair) => pair.split("=")));
    const numbers = (text) => (text ?? "").split(",").map(Number).filter(Number.isFinite);
    const [time] = numbers(parts.t);
    if (parts.t && time >= 0 && time <= trial.end) trial.time = time;
    for (const name of (parts.hide ?? "").split(",").filter(Boolean)) trial.hidden.add(name);
    for (const name of (parts.off ?? "").split(",")) if (name in trial.scene.shown) trial.scene.shown[name] = false;
    if (["follow", "fly"].includes(parts.camera)) trial.scene.camera = parts.camera;
    const named = biflag.Scene.VIEWS[parts.look];
    if (named) trial.scene.view = { ...named };
    const [azimuth, elevation, zoom] = numbers(parts.look);
    const has = (flag) => parts.look.split(",").includes(flag);
    if (zoom >= 0.5 && zoom <= 6) trial.scene.view = { azimuth, elevation, zoom, flat: has("flat"), whole: has("whole") };
    trial.pressed();
    if (trial.hidden.size) for (const chart of trial.charts) chart.build();
    const range = numbers(parts.range);
    if (parts.range && range.length === 2) trial.zoom(range);
  }
};
