// The 3-D view: the robot solid in its box of glycerin, the model beside it as a ghost, forces, the trails of the tips, light
// where the flagella touch, the scale of the yaw, axes and scales of length and force. World axes; lengths are in metres.
"use strict";

/** Drawing the robot may take so much of a sixtieth of a second. */
const SLOW_MS = 10;
/** The scale of the forces is that of this force at least, mN. */
const LEAST_SCALE_MN = 2;
/** A trail shows where a tip has been for so long, s, by so many points. */
const TRAIL_S = 2;
const TRAIL_POINTS = 72;
/** The camera of the fly-by swings about its place: radians to each side and up, and s for a whole swing of each. */
const FLY = { azimuth: 0.6, azimuth_s: 24, elevation: 0.14, elevation_s: 37 };

biflag.Scene = class {
  /** Where the robot is seen from. Flat views, along an axis, have no perspective; `whole`: the tank fills the view. */
  static VIEWS = {
    perspective: { azimuth: -0.62, elevation: 0.52, zoom: 1, flat: false, whole: false },
    tank: { azimuth: -0.95, elevation: 0.4, zoom: 1, flat: false, whole: true },
    top: { azimuth: 0, elevation: Math.PI / 2, zoom: 1, flat: true, whole: false },
    front: { azimuth: 0, elevation: 0, zoom: 1, flat: true, whole: false },
    side: { azimuth: Math.PI / 2, elevation: 0, zoom: 1, flat: true, whole: false },
  };

  constructor(canvas, trial) {
    this.canvas = canvas;
    this.trial = trial;
    this.robots = trial.data.robots.map((robot) => new biflag.Robot(robot));
    this.view = { ...biflag.Scene.VIEWS.perspective };
    this.shown = { ghost: true, forces: true, trails: true };
    /** What moves the camera: nothing (`still`), the robot's yaw (`follow`), or the time that it has flown (`fly`). */
    this.camera = "still";
    this.flown_s = 0;
    /** Pixels of the canvas for one of the page, while a film needs the same size all the time. */
    this.ratio = null;
    this.strongest = this.largestForce();
    this.paint();
    biflag.takeHand(this);
  }

  get hasGhost() {
    return this.trial.tables.attitude.model_yaw !== undefined;
  }

  /** The largest force of the trial, mN; 0 without forces. */
  largestForce() {
    const { forces } = this.trial.tables;
    if (!forces) return 0;
    let most = 0;
    for (const k of [1, 2]) {
      const [x, y, z] = ["x", "y", "z"].map((axis) => forces[axis + k]);
      for (let i = 0; i < z.length; i++) most = Math.max(most, Math.hypot(x[i], y[i], z[i]));
    }
    return most;
  }

  /** Takes up the page's present colours. */
  paint() {
    const names = ["base", "flagellum1", "flagellum2", "force", "spark"];
    const colours = Object.fromEntries(names.map((name) => [name, biflag.rgb(name)]));
    this.rgb = (name) => colours[name];
    this.bases = this.robots.map((robot) => robot.base(this.rgb));
    const lines = ["soft", "line", "grid", "ink", "measured", "model", "force", "flagellum1", "flagellum2", "base", "card", "glycerin", "shadow"];
    this.css = Object.fromEntries(lines.map((name) => [name, biflag.colour(name)]));
    this.font = biflag.colour("font");
  }

  /** Yaw, pitch and roll in radians, or null where the log has none. */
  attitude(prefix, time) {
    const angles = ["yaw", "pitch", "roll"].map((name) => biflag.valueAt(this.trial, "attitude", prefix + name, time));
    return angles.includes(null) || angles.includes(undefined) ? null : angles.map((angle) => (angle * Math.PI) / 180);
  }

  /** Azimuth and elevation of the camera when the robot has a yaw, radians. */
  place(yaw) {
    const { azimuth, elevation } = this.view;
    if (this.camera === "follow") return [azimuth + yaw, elevation];
    if (this.camera !== "fly") return [azimuth, elevation];
    const swing = (period_s) => Math.sin((2 * Math.PI * this.flown_s) / period_s);
    return [azimuth + FLY.azimuth * swing(FLY.azimuth_s), elevation + FLY.elevation * swing(FLY.elevation_s)];
  }

  /** The camera: a projection onto the canvas for lines, and the same as a matrix for solids. */
  lens(width, height, yaw) {
    const [robot] = this.robots;
    const { zoom, flat, whole } = this.view;
    const [azimuth, elevation] = this.place(yaw);
    const [ca, sa, ce, se] = [Math.cos(azimuth), Math.sin(azimuth), Math.cos(elevation), Math.sin(elevation)];
    const [right, away, up] = [[ca, sa, 0], [-sa * ce, ca * ce, -se], [-sa * se, ca * se, ce]];
    const { middle, reach, wide, tall } = whole
      ? biflag.Tank.frame(robot.tank, right, up)
      : { middle: [0, 0, -0.45 * robot.reach], reach: robot.reach, wide: 1.05 * robot.reach, tall: robot.reach * (1.5 * Math.abs(ce) + 1.05 * Math.abs(se)) };
    const scale = zoom * Math.min(height / tall, width / wide);
    const far = flat ? Infinity : 9 * reach;
    const project = (point) => {
      const p = biflag.minus(point, middle);
      const depth = biflag.dot(p, away);
      const near = scale / (1 + depth / far);
      return [width / 2 + biflag.dot(p, right) * near, height / 2 - biflag.dot(p, up) * near, depth, near];
    };
    const rows = [right.map((x) => (2 * scale * x) / width), up.map((x) => (2 * scale * x) / height), away.map((x) => x / (4 * reach)), away.map((x) => x / far)];
    const shift = rows.map((row, i) => -biflag.dot(row, middle) + (i === 3 ? 1 : 0));
    const camera = [0, 1, 2].flatMap((k) => rows.map((row) => row[k])).concat(shift);
    const eye = away.map((x) => -x);
    const light = biflag.unit(eye.map((x, k) => 0.75 * x - 0.45 * right[k] + 0.6 * up[k]));
    return { project, camera, eye, away, light, scale, right, up };
  }

  draw(time) {
    const begun = performance.now();
    const { canvas } = this;
    // Without a graphics card, many pixels take longer than a frame: the robot moves in coarser ones.
    const ratio = this.ratio ?? (this.trial.playing && this.isSlow ? 1 : devicePixelRatio);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (!width || !height) return;
    const size = [Math.round(width * ratio), Math.round(height * ratio)];
    if (canvas.width !== size[0] || canvas.height !== size[1]) [canvas.width, canvas.height] = size;
    const ctx = canvas.getContext("2d");
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    // A canvas that changes its size forgets this.
    ctx.lineJoin = "round";
    ctx.fillStyle = this.css.card;
    ctx.fillRect(0, 0, width, height);

    const own = this.attitude("", time);
    const lens = this.lens(width, height, own?.[0] ?? 0);
    const model = this.hasGhost && this.shown.ghost ? this.attitude("model_", time) : null;
    const [solid, ghost] = [this.robots[0], this.robots[1] ?? this.robots[0]];
    const lines = [0, 1].map((k) => solid.line(k, time));
    const turn = biflag.rotation(own ?? [0, 0, 0]);
    const above = lens.away[2] < -0.05;
    const draw2d = { ctx, ...lens, path: (points, colour, thick, dash = []) => biflag.path(ctx, points.map(lens.project), colour, thick, dash) };
    const tank = new biflag.Tank(solid.tank, draw2d, this.css);
    tank.behind();
    tank.shadows(lines.map((line) => line.map((point) => biflag.turned(turn, point))), solid.body);
    const told = this.told(time);
    const corner = this.tell(ctx, told, false);
    const numbers = this.numbers(draw2d, corner);
    if (!above) this.compass(draw2d, own, model);
    this.vertical(draw2d);
    const forces = this.forces(time);
    const contacts = this.contacts(solid, lines, time).map((point) => biflag.turned(turn, point));
    const renderer = biflag.Renderer.shared();
    if (renderer.works) {
      const still = biflag.rotation([0, 0, 0]);
      const solids = [
        { mesh: this.bases[0], turn },
        { mesh: solid.rods(lines, this.rgb), turn, glows: true },
        { mesh: solid.arrows(forces, this.metresPerMn(), this.rgb), turn },
      ];
      if (this.shown.trails) solids.push({ mesh: this.trails(solid, time), turn: still });
      if (model) {
        const modelTurn = biflag.rotation(model);
        const modelLines = ghost === solid ? lines : [0, 1].map((k) => ghost.line(k, time));
        const mesh = ghost.rods(modelLines, this.rgb);
        solids.push({ mesh: this.bases.at(-1), turn: modelTurn, ghost: true }, { mesh, turn: modelTurn, ghost: true });
      }
      const lights = { places: contacts, colour: this.rgb("spark"), reach: 2.2 * solid.body.rod_radius_m };
      const picture = renderer.draw(...size, lens, solids, lights);
      ctx.drawImage(picture, 0, 0, width, height);
      picture.close();
    } else {
      this.wires(draw2d, solid, lines, turn);
    }
    this.halos(draw2d, solid, contacts);
    if (above) this.compass(draw2d, own, model);
    tank.before();
    this.label(ctx, numbers);
    this.names(draw2d, solid, forces, turn);
    this.scales(draw2d, width, height);
    this.tell(ctx, told, true);
    this.isSlow ||= this.trial.playing && performance.now() - begun > SLOW_MS;
  }

  /** The paths of both tips up to a time, thinner the longer ago. */
  trails(robot, time) {
    const mesh = new biflag.Mesh();
    const radius = 0.5 * robot.body.rod_radius_m;
    const from = Math.max(0, time - TRAIL_S);
    if (time - from < 0.01) return mesh;
    const times = robot.trailTimes(from, time, TRAIL_POINTS);
    const turns = times.map((t) => biflag.rotation(this.attitude("", t) ?? [0, 0, 0]));
    for (const k of [0, 1]) {
      const tips = times.map((t, i) => biflag.turned(turns[i], robot.tip(k, t)));
      const path = biflag.smooth(tips, Math.max(1, Math.round(TRAIL_POINTS / tips.length)));
      const moved = path.some((point) => Math.hypot(...biflag.minus(point, path[0])) > radius);
      const pale = this.rgb(`flagellum${k + 1}`).map((part) => 0.55 * part + 0.45);
      if (moved) mesh.tube(path, (i) => radius * (0.12 + (0.88 * i) / (path.length - 1)), pale, 6);
    }
    return mesh;
  }

  /** Places between the flagella where they touch at a time, body axes. Rigid helices only stand for the real shapes. */
  contacts(robot, lines, time) {
    const { forces } = this.trial.tables;
    if (robot.shapes.rigid || !forces || !(biflag.valueAt(this.trial, "forces", "contact", time) > 0)) return [];
    return biflag.touching(lines, 2 * robot.body.rod_radius_m);
  }

  /** The light of the contacts about the flagella. */
  halos({ ctx, project }, robot, contacts) {
    const [r, g, b] = this.rgb("spark").map((part) => Math.round(255 * part));
    for (const place of contacts) {
      const [x, y, , near] = project(place);
      const radius = 5 * robot.body.rod_radius_m * near;
      const glow = ctx.createRadialGradient(x, y, 0, x, y, radius);
      glow.addColorStop(0, `rgb(${r} ${g} ${b} / 0.5)`);
      glow.addColorStop(0.35, `rgb(${r} ${g} ${b} / 0.18)`);
      glow.addColorStop(1, `rgb(${r} ${g} ${b} / 0)`);
      ctx.fillStyle = glow;
      ctx.fillRect(x - radius, y - radius, 2 * radius, 2 * radius);
    }
  }

  /** Time, yaw and the model's yaw, each with its colour, so that a picture or a film says what it shows. */
  told(time) {
    const { own = "yaw", other } = this.trial.data;
    const yaw = (prefix) => biflag.format(biflag.valueAt(this.trial, "attitude", prefix + "yaw", time), 1);
    const hasModel = this.hasGhost && this.shown.ghost;
    const lines = [["soft", `${time.toFixed(1)} s`], ["measured", `ψ ${yaw("")}°${hasModel ? " " + own : ""}`]];
    if (hasModel) lines.push(["model", `ψ ${yaw("model_")}° ${other}`]);
    return lines;
  }

  /** Writes lines in the upper left corner, or only returns where each ends: on the right, above and below. */
  tell(ctx, lines, writes) {
    this.write(ctx, "left", "top");
    ctx.font = `600 12px ${this.font}`;
    lines.forEach(([colour, words], i) => {
      if (!writes) return;
      ctx.fillStyle = this.css[colour];
      ctx.fillText(words, 12, 11 + 16.5 * i);
    });
    return lines.map(([, words], i) => [12 + ctx.measureText(words).width, 11 + 16.5 * i, 25 + 16.5 * i]);
  }

  /** The forces of both flagella at a time, mN. */
  forces(time) {
    if (!this.strongest || !this.shown.forces) return [];
    return [1, 2].map((k) => ["x", "y", "z"].map((axis) => biflag.valueAt(this.trial, "forces", axis + k, time)));
  }

  /** Metres of an arrow for each mN: the largest force is a third as long as the robot. Arrows of a robot at rest stay short. */
  metresPerMn() {
    return (0.33 * this.robots[0].reach) / Math.max(this.strongest, LEAST_SCALE_MN);
  }

  /** Without WebGL: the outline of the base, and the centre lines. */
  wires({ path }, robot, lines, turn) {
    const { radius_m: radius, height_m: height } = robot.body;
    const ring = (z) => Array.from({ length: 41 }, (_, i) => biflag.turned(turn, [radius * Math.cos((i * Math.PI) / 20), radius * Math.sin((i * Math.PI) / 20), z]));
    const [low, high] = [ring(-height), ring(0)];
    for (const line of [low, high, ...[0, 10, 20, 30].map((i) => [low[i], high[i]])]) path(line, this.css.base, 2);
    lines.forEach((line, k) => path(line.map((point) => biflag.turned(turn, point)), this.css[`flagellum${k + 1}`], 4));
  }

  /** Returns a point of the ring that is the scale of the yaw: at an angle, and at a share of its radius. */
  onRing(angle, share) {
    const reach = this.robots[0].reach;
    const r = 0.24 * reach * share;
    return [r * Math.cos(angle), r * Math.sin(angle), 0.1 * reach];
  }

  /** Returns the numbers of the scale of the yaw and their places: outside of the ring, or inside where the words of the corner
   * are. */
  numbers({ project, scale }, corner) {
    // A small ring has no room for numbers.
    if (0.24 * this.robots[0].reach * scale < 24) return [];
    const numbers = [];
    // Seen from the side, opposite angles are at one place.
    const isFree = ([x, y]) => numbers.every(([, u, v]) => Math.hypot(x - u, y - v) >= 22);
    const isClear = ([x, y]) => corner.every(([right, top, bottom]) => x - 14 > right || y + 6 < top || y - 6 > bottom);
    for (const [i, words] of ["0°", "90°", "180°", "−90°"].entries()) {
      const places = [1.24, 0.62].map((share) => project(this.onRing((i * Math.PI) / 2, share)));
      const place = places.find(isClear) ?? places[0];
      if (isFree(place)) numbers.push([words, place[0], place[1]]);
    }
    return numbers;
  }

  /** Writes words at places, on a plate that keeps them legible in front of the robot: on paper, rims of letters are a second
   * text. */
  label(ctx, words) {
    this.write(ctx, "center", "middle");
    for (const [text, x, y] of words) {
      const width = ctx.measureText(text).width + 4;
      [ctx.fillStyle, ctx.globalAlpha] = [this.css.card, 0.7];
      ctx.fillRect(x - width / 2, y - 7, width, 13);
      [ctx.fillStyle, ctx.globalAlpha] = [this.css.soft, 1];
      ctx.fillText(text, x, y);
    }
  }

  /** The scale of the yaw with its pointers. */
  compass({ ctx, project, path }, own, model) {
    const on = (angle, share) => this.onRing(angle, share);
    path(Array.from({ length: 73 }, (_, i) => on((i * Math.PI) / 36, 1)), this.css.line, 1.2);
    for (let i = 0; i < 12; i++) {
      const angle = (i * Math.PI) / 6;
      path([on(angle, 1), on(angle, i % 3 ? 0.95 : 0.89)], this.css.line, 1.2);
    }
    const middle = on(0, 0);
    if (model && own) this.wedge(ctx, project, middle, (angle) => on(angle, 0.89), own[0], model[0]);
    if (model) path([middle, on(model[0], 1)], this.css.model, 2, [5, 3]);
    if (own) path([middle, on(own[0], 1)], this.css.measured, 2.5);
  }

  /** The difference of two yaws as a filled piece of the ring. */
  wedge(ctx, project, middle, on, from, to) {
    const steps = Math.min(90, Math.ceil(Math.abs(to - from) / 0.06) + 1);
    ctx.beginPath();
    for (const point of [middle, ...Array.from({ length: steps + 1 }, (_, i) => on(from + ((to - from) * i) / steps))]) ctx.lineTo(...project(point).slice(0, 2));
    ctx.closePath();
    ctx.globalAlpha = 0.28;
    ctx.fillStyle = this.css.model;
    ctx.fill();
    ctx.globalAlpha = 1;
  }

  vertical({ path }) {
    const reach = this.robots[0].reach;
    path([[0, 0, 0], [0, 0, -1.1 * reach]], this.css.line, 1, [3, 4]);
    path([[0, 0, 0.1 * reach], [0, 0, 0]], this.css.base, 2);
  }

  /** The strengths of the forces, beside the feet of their arrows. */
  names({ ctx, project }, robot, forces, turn) {
    this.write(ctx, "left", "middle");
    // A rim of the background keeps the words legible in front of the robot.
    [ctx.strokeStyle, ctx.lineWidth] = [this.css.card, 3];
    forces.forEach((force, k) => {
      if (force.includes(null)) return;
      const foot = robot.foot(k);
      const tip = foot.map((x, i) => x + 1.12 * force[i] * this.metresPerMn());
      const [x0, y] = project(biflag.turned(turn, foot));
      const [x1] = project(biflag.turned(turn, tip));
      // Beside the arrow and away from the robot's axis, so that the words cover neither.
      const isLeft = x0 < this.canvas.clientWidth / 2;
      const x = isLeft ? Math.min(x0, x1) - 6 : Math.max(x0, x1) + 6;
      ctx.fillStyle = this.css.force;
      ctx.textAlign = isLeft ? "right" : "left";
      const words = `F${"₁₂"[k]} ${biflag.format(Math.hypot(...force), 1)} mN`;
      ctx.strokeText(words, x, y);
      ctx.fillText(words, x, y);
    });
  }

  /** World axes in a corner, and how long 50 mm and a round force are. */
  scales({ ctx, scale, right, up }, width, height) {
    this.write(ctx, "center", "middle");
    const [x0, y0, length] = [38, height - 40, 24];
    for (const [i, name] of ["x", "y", "z"].entries()) {
      const [dx, dy] = [length * right[i], -length * up[i]];
      biflag.path(ctx, [[x0, y0], [x0 + dx, y0 + dy]], this.css.soft, 1.5);
      if (Math.hypot(dx, dy) > 8) ctx.fillText(name, x0 + 1.4 * dx, y0 + 1.4 * dy);
    }
    const bar = (text, metres, y, colour) => {
      const pixels = metres * scale;
      biflag.path(ctx, [[width - 14 - pixels, y - 4], [width - 14 - pixels, y], [width - 14, y], [width - 14, y - 4]], colour, 1.5);
      ctx.textAlign = "right";
      ctx.fillStyle = colour;
      ctx.fillText(text, width - 14, y - 11);
    };
    bar("50 mm", 0.05, height - 14, this.css.soft);
    if (!this.strongest || !this.shown.forces) return;
    const round = biflag.roundBelow(this.strongest / 2);
    bar(`${round} mN`, round * this.metresPerMn(), height - 44, this.css.force);
  }

  write(ctx, align, baseline) {
    ctx.fillStyle = this.css.soft;
    ctx.font = `11px ${this.font}`;
    ctx.textAlign = align;
    ctx.textBaseline = baseline;
  }

  turn(azimuth, elevation) {
    this.view.azimuth += azimuth;
    this.view.elevation = Math.min(Math.max(this.view.elevation + elevation, -1.4), 1.4);
    this.view.flat = false;
    this.trial.changed();
  }

  zoom(factor) {
    this.view.zoom = Math.min(Math.max(this.view.zoom * factor, 0.5), 6);
    this.trial.changed();
  }

  look(name) {
    this.view = { ...biflag.Scene.VIEWS[name] };
    this.trial.changed();
  }

  /** Lets the camera follow the robot or fly; a second time, it stands still. */
  move(camera) {
    this.camera = this.camera === camera ? "still" : camera;
    this.flown_s = 0;
    this.trial.changed();
  }
};

biflag.path = (ctx, points, colour, width, dash = []) => {
  ctx.beginPath();
  points.forEach(([x, y], i) => (i ? ctx.lineTo(x, y) : ctx.moveTo(x, y)));
  ctx.strokeStyle = colour;
  ctx.lineWidth = width;
  ctx.setLineDash(dash);
  ctx.stroke();
  ctx.setLineDash([]);
};

/** The largest of 1, 2, 5, 10, … (and tenths) that is not above a value. */
biflag.roundBelow = (value) => {
  const decade = 10 ** Math.floor(Math.log10(value));
  return Number(([5, 2, 1].find((k) => k * decade <= value) * decade).toPrecision(1));
};
