// The 3-D view: the robot solid, the model beside it as a ghost, forces, the scale of the yaw, axes and scales of length and
// force. World axes; lengths are in metres.
"use strict";

/** Drawing the robot may take so much of a sixtieth of a second. */
const SLOW_MS = 10;
/** The scale of the forces is that of this force at least, mN. */
const LEAST_SCALE_MN = 2;

biflag.Scene = class {
  /** Where the robot is seen from; flat views, along an axis, have no perspective. */
  static VIEWS = {
    perspective: { azimuth: -1.05, elevation: 0.34, zoom: 1, flat: false },
    top: { azimuth: 0, elevation: Math.PI / 2, zoom: 1, flat: true },
    front: { azimuth: 0, elevation: 0, zoom: 1, flat: true },
    side: { azimuth: Math.PI / 2, elevation: 0, zoom: 1, flat: true },
  };

  constructor(canvas, trial) {
    this.canvas = canvas;
    this.trial = trial;
    this.robots = trial.data.robots.map((robot) => new biflag.Robot(robot));
    this.view = { ...biflag.Scene.VIEWS.perspective };
    this.shown = { ghost: true, forces: true };
    this.strongest = this.largestForce();
    this.paint();
    this.listen();
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
    const names = ["base", "flagellum1", "flagellum2", "force"];
    const colours = Object.fromEntries(names.map((name) => [name, biflag.rgb(name)]));
    this.rgb = (name) => colours[name];
    this.bases = this.robots.map((robot) => robot.base(this.rgb));
    const lines = ["soft", "line", "grid", "ink", "measured", "model", "force", "flagellum1", "flagellum2", "base", "card"];
    this.css = Object.fromEntries(lines.map((name) => [name, biflag.colour(name)]));
    this.font = biflag.colour("font");
  }

  /** Yaw, pitch and roll in radians, or null where the log has none. */
  attitude(prefix, time) {
    const angles = ["yaw", "pitch", "roll"].map((name) => biflag.valueAt(this.trial, "attitude", prefix + name, time));
    return angles.includes(null) || angles.includes(undefined) ? null : angles.map((angle) => (angle * Math.PI) / 180);
  }

  /** The camera: a projection onto the canvas for lines, and the same as a matrix for solids. */
  lens(width, height) {
    const reach = this.robots[0].reach;
    const { azimuth, elevation, zoom, flat } = this.view;
    const [ca, sa, ce, se] = [Math.cos(azimuth), Math.sin(azimuth), Math.cos(elevation), Math.sin(elevation)];
    const [right, away, up] = [[ca, sa, 0], [-sa * ce, ca * ce, -se], [-sa * se, ca * se, ce]];
    const tall = reach * (1.5 * Math.abs(ce) + 0.72 * Math.abs(se));
    const scale = zoom * Math.min(height / tall, width / (reach * 0.9));
    const middle = [0, 0, -0.47 * reach];
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
    return { project, camera, eye, light, scale, right, up };
  }

  draw(time) {
    const begun = performance.now();
    const { canvas } = this;
    // Without a graphics card, many pixels take longer than a frame: the robot moves in coarser ones.
    const ratio = this.trial.playing && this.isSlow ? 1 : devicePixelRatio;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (!width || !height) return;
    const size = [Math.round(width * ratio), Math.round(height * ratio)];
    if (canvas.width !== size[0] || canvas.height !== size[1]) [canvas.width, canvas.height] = size;
    const ctx = canvas.getContext("2d");
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    ctx.clearRect(0, 0, width, height);

    const lens = this.lens(width, height);
    const own = this.attitude("", time);
    const model = this.hasGhost && this.shown.ghost ? this.attitude("model_", time) : null;
    const [solid, ghost] = [this.robots[0], this.robots[1] ?? this.robots[0]];
    const lines = [0, 1].map((k) => solid.line(k, time));
    const turn = biflag.rotation(own ?? [0, 0, 0]);
    const above = this.view.elevation > 0.05;
    const draw2d = { ctx, ...lens, path: (points, colour, thick, dash = []) => biflag.path(ctx, points.map(lens.project), colour, thick, dash) };
    if (!above) this.compass(draw2d, own, model);
    for (const line of lines) this.shadow(draw2d, line.map((point) => biflag.turned(turn, point)));
    this.vertical(draw2d);
    const forces = this.forces(time);
    const renderer = biflag.Renderer.shared();
    if (renderer.works) {
      const solids = [
        { mesh: this.bases[0], turn },
        { mesh: solid.rods(lines, this.rgb), turn },
        { mesh: solid.arrows(forces, this.metresPerMn(), this.rgb), turn },
      ];
      if (model) {
        const modelTurn = biflag.rotation(model);
        const modelLines = ghost === solid ? lines : [0, 1].map((k) => ghost.line(k, time));
        const mesh = ghost.rods(modelLines, this.rgb);
        solids.push({ mesh: this.bases[this.bases.length - 1], turn: modelTurn, ghost: true }, { mesh, turn: modelTurn, ghost: true });
      }
      const picture = renderer.draw(...size, lens, solids);
      ctx.drawImage(picture, 0, 0, width, height);
      picture.close();
    } else {
      this.wires(draw2d, solid, lines, turn);
    }
    if (above) this.compass(draw2d, own, model);
    this.names(draw2d, solid, forces, turn);
    this.scales(draw2d, width, height);
    this.isSlow ||= this.trial.playing && performance.now() - begun > SLOW_MS;
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

  /** The scale of the yaw with its pointers. */
  compass({ ctx, project, path }, own, model) {
    const reach = this.robots[0].reach;
    const [radius, z] = [0.24 * reach, 0.1 * reach];
    const on = (angle, r) => [r * Math.cos(angle), r * Math.sin(angle), z];
    path(Array.from({ length: 73 }, (_, i) => on((i * Math.PI) / 36, radius)), this.css.line, 1.2);
    this.write(ctx, "center", "middle");
    const written = [];
    for (let i = 0; i < 12; i++) {
      const angle = (i * Math.PI) / 6;
      path([on(angle, radius), on(angle, radius * (i % 3 ? 0.95 : 0.89))], this.css.line, 1.2);
      if (i % 3) continue;
      const [x, y] = project(on(angle, radius * 1.24));
      // Seen from the side, opposite angles are at one place.
      if (written.some(([u, v]) => Math.hypot(x - u, y - v) < 22)) continue;
      written.push([x, y]);
      ctx.fillText(["0°", "90°", "180°", "−90°"][i / 3], x, y);
    }
    if (model) path([[0, 0, z], on(model[0], radius)], this.css.model, 2, [5, 3]);
    if (own) path([[0, 0, z], on(own[0], radius)], this.css.measured, 2.5);
  }

  vertical({ path }) {
    const reach = this.robots[0].reach;
    path([[0, 0, 0], [0, 0, -1.12 * reach]], this.css.line, 1, [3, 4]);
    path([[0, 0, 0.1 * reach], [0, 0, 0]], this.css.base, 2);
  }

  shadow({ path, ctx }, line) {
    const floor = -1.1 * this.robots[0].reach;
    ctx.lineCap = ctx.lineJoin = "round";
    path(line.map(([x, y]) => [x, y, floor]), this.css.grid, 4);
    ctx.lineCap = "butt";
  }

  /** The strengths of the forces, beside the feet of their arrows. */
  names({ ctx, project }, robot, forces, turn) {
    this.write(ctx, "left", "middle");
    // A rim of the background keeps the words legible in front of the robot.
    [ctx.strokeStyle, ctx.lineWidth, ctx.lineJoin] = [this.css.card, 3, "round"];
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

  listen() {
    const { canvas } = this;
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      canvas.classList.add("held");
    });
    canvas.addEventListener("pointermove", (event) => {
      if (canvas.hasPointerCapture(event.pointerId)) this.turn(-event.movementX * 0.01, event.movementY * 0.01);
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => canvas.classList.remove("held"));
    canvas.addEventListener("wheel", (event) => {
      // Without a modifier key, the wheel scrolls the page.
      if (!event.ctrlKey && !event.metaKey) return;
      event.preventDefault();
      this.zoom(Math.exp(-event.deltaY * 0.002));
    }, { passive: false });
    canvas.addEventListener("dblclick", () => this.look("perspective"));
    const keys = {
      ArrowLeft: () => this.turn(0.1, 0),
      ArrowRight: () => this.turn(-0.1, 0),
      ArrowUp: () => this.turn(0, 0.1),
      ArrowDown: () => this.turn(0, -0.1),
      "+": () => this.zoom(1.2),
      "=": () => this.zoom(1.2),
      "-": () => this.zoom(1 / 1.2),
      Home: () => this.look("perspective"),
      " ": () => this.trial.toggle(),
    };
    canvas.addEventListener("keydown", (event) => {
      const act = keys[event.key];
      if (!act || event.ctrlKey || event.altKey || event.metaKey) return;
      event.preventDefault();
      act();
    });
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
