// The view of the robot: base, motors and both flagella on a plain canvas, drawn from back to front. Lengths are in metres,
// z is up, and the robot hangs from the joint at the origin.
"use strict";

biflag.Scene = class {
  static HOME = { azimuth: -1.05, elevation: 0.34, zoom: 1 };

  constructor(canvas, trial) {
    this.canvas = canvas;
    this.trial = trial;
    this.body = trial.data.body;
    this.view = { ...biflag.Scene.HOME };
    this.shapes = this.unpack(trial.data.shapes);
    this.solids = this.robot();
    this.listen();
  }

  unpack(packed) {
    const numbers = new Int16Array(biflag.bytes(packed.i16));
    return { ...packed, time: biflag.numbers(packed.time), numbers, each: packed.nodes * 3, feet: packed.feet_m };
  }

  /** The robot's faces in body axes: corners and the colour of their solid. */
  robot() {
    const { radius_m: radius, height_m: height } = this.body;
    const faces = [];
    const cylinder = (x, r, low, high, colour, sides) => {
      const ring = (z) => Array.from({ length: sides }, (_, i) => {
        const a = (2 * Math.PI * i) / sides;
        return [x + r * Math.cos(a), r * Math.sin(a), z];
      });
      const [bottom, top] = [ring(low), ring(high)];
      for (let i = 0; i < sides; i++) {
        const j = (i + 1) % sides;
        faces.push({ corners: [bottom[i], bottom[j], top[j], top[i]], colour });
      }
      faces.push({ corners: top, colour }, { corners: bottom.slice().reverse(), colour });
    };
    cylinder(0, radius, -height, 0, "base", 28);
    for (const [k, foot] of this.shapes.feet.entries()) {
      cylinder(foot[0], 0.42 * radius, -height, -0.2 * height, k ? "flagellum2" : "flagellum1", 18);
      const [near, far, y] = [0.9 * radius, Math.abs(foot[0]) - 0.3 * radius, 0.25 * radius];
      const side = Math.sign(foot[0]) || 1;
      for (const z of [-0.85 * height, -0.4 * height]) this.box(faces, side * near, side * far, y, z, 0.09 * height);
    }
    return faces;
  }

  box(faces, x0, x1, y, z, h) {
    const [a, b] = [Math.min(x0, x1), Math.max(x0, x1)];
    if (b - a < 1e-4) return;
    const p = (x, s, t) => [x, s * y, z + t * h];
    const colour = "base";
    faces.push(
      { corners: [p(a, -1, -1), p(b, -1, -1), p(b, -1, 1), p(a, -1, 1)], colour },
      { corners: [p(b, 1, -1), p(a, 1, -1), p(a, 1, 1), p(b, 1, 1)], colour },
      { corners: [p(a, -1, 1), p(b, -1, 1), p(b, 1, 1), p(a, 1, 1)], colour },
      { corners: [p(a, 1, -1), p(b, 1, -1), p(b, -1, -1), p(a, -1, -1)], colour },
    );
  }

  /** Centre line of flagellum `k` in body axes at a time. */
  line(k, time) {
    const { shapes, trial } = this;
    const turns = trial.tables.turns;
    const t = time - trial.data.turns.shift_s;
    const i = biflag.before(shapes.time, t);
    const j = Math.min(i + 1, shapes.time.length - 1);
    const share = j > i ? Math.min(Math.max((t - shapes.time[i]) / (shapes.time[j] - shapes.time[i]), 0), 1) : 0;
    const angle = 2 * Math.PI * (biflag.at(turns.time, k ? turns.two : turns.one, t) ?? 0);
    const [c, s] = [Math.cos(angle), Math.sin(angle)];
    const foot = shapes.feet[k];
    const points = [];
    for (let n = 0; n < shapes.nodes; n++) {
      const part = (frame, axis) => shapes.numbers[(2 * frame + k) * shapes.each + 3 * n + axis];
      const [x, y, z] = [0, 1, 2].map((axis) => shapes.unit_m * (part(i, axis) * (1 - share) + part(j, axis) * share));
      points.push([foot[0] + c * x - s * y, foot[1] + s * x + c * y, foot[2] + z]);
    }
    return biflag.smooth(points, shapes.nodes > 40 ? 2 : 4);
  }

  draw(time) {
    const { canvas, trial } = this;
    const ratio = devicePixelRatio;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (!width || !height) return;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    const ctx = canvas.getContext("2d");
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    ctx.clearRect(0, 0, width, height);

    const reach = this.body.height_m + this.body.length_m;
    const tall = reach * 1.48;
    const scale = (this.view.zoom * Math.min(height / tall, width / (reach * 0.9)));
    const [ca, sa] = [Math.cos(this.view.azimuth), Math.sin(this.view.azimuth)];
    const [ce, se] = [Math.cos(this.view.elevation), Math.sin(this.view.elevation)];
    const middle = -0.47 * reach;
    /** Projects onto the canvas with slight perspective: x, y, depth, and scale at that depth. */
    const project = ([x, y, z]) => {
      const [right, away, up] = [ca * x + sa * y, ca * y - sa * x, z - middle];
      const depth = away * ce - up * se;
      const near = scale / (1 + depth / (9 * reach));
      return [width / 2 + right * near, height / 2 - (up * ce + away * se) * near, depth, near];
    };
    const degree = Math.PI / 180;
    const angles = (prefix) => ["yaw", "pitch", "roll"].map((name) => trial.value("attitude", prefix + name, time));
    const measured = angles("").map((angle) => (angle ?? 0) * degree);
    const model = angles("model_");
    const turn = biflag.rotation(measured);

    const colours = {};
    for (const name of ["base", "flagellum1", "flagellum2", "soft", "line", "measured", "model", "grid", "paper", "ink"]) {
      colours[name] = biflag.colour(name);
    }
    const parts = [];
    this.surroundings(ctx, project, colours, measured[0], model[0] === null ? null : model[0] * degree, reach);

    for (const face of this.solids) {
      const corners = face.corners.map((corner) => project(turn(corner)));
      // A face that looks away is hidden by its solid.
      const area = corners.reduce((sum, [x, y], i) => {
        const [u, v] = corners[(i + 1) % corners.length];
        return sum + x * v - u * y;
      }, 0);
      if (area >= 0) continue;
      const depth = corners.reduce((sum, corner) => sum + corner[2], 0) / corners.length;
      const light = biflag.light(face.corners, turn);
      parts.push({ depth, paint: () => {
        ctx.beginPath();
        corners.forEach(([x, y], i) => (i ? ctx.lineTo(x, y) : ctx.moveTo(x, y)));
        ctx.closePath();
        ctx.fillStyle = ctx.strokeStyle = biflag.shade(colours[face.colour], light);
        ctx.lineWidth = 0.6;
        ctx.fill();
        ctx.stroke();
      } });
    }
    for (const k of [0, 1]) {
      const line = this.line(k, time).map(turn);
      this.shadow(ctx, project, line, colours, reach);
      const shaft = [turn(this.shapes.feet[k]), line[0]];
      this.tube(parts, ctx, project, [...shaft], colours.base, 0.5 * this.body.rod_radius_m);
      this.tube(parts, ctx, project, line, colours[k ? "flagellum2" : "flagellum1"], this.body.rod_radius_m);
    }
    parts.sort((a, b) => b.depth - a.depth);
    for (const part of parts) part.paint();
  }

  /** The scale of the yaw with its pointers, and the vertical through the joint. */
  surroundings(ctx, project, colours, yaw, modelYaw, reach) {
    const [radius, z] = [0.24 * reach, 0.1 * reach];
    const on = (angle, r) => project([r * Math.cos(angle), r * Math.sin(angle), z]);
    const path = (points, colour, width, dash = []) => {
      ctx.beginPath();
      points.forEach(([x, y], i) => (i ? ctx.lineTo(x, y) : ctx.moveTo(x, y)));
      ctx.strokeStyle = colour;
      ctx.lineWidth = width;
      ctx.setLineDash(dash);
      ctx.stroke();
      ctx.setLineDash([]);
    };
    path([project([0, 0, z]), project([0, 0, -1.12 * reach])], colours.line, 1, [3, 4]);
    const circle = Array.from({ length: 73 }, (_, i) => on((i * Math.PI) / 36, radius));
    path(circle, colours.line, 1.2);
    ctx.fillStyle = colours.soft;
    ctx.font = `11px ${biflag.colour("font")}`;
    ctx.textAlign = "center";
    ctx.textBaseline = "middle";
    for (let i = 0; i < 12; i++) {
      const angle = (i * Math.PI) / 6;
      path([on(angle, radius), on(angle, radius * (i % 3 ? 0.95 : 0.89))], colours.line, 1.2);
      if (i % 3 === 0) {
        const [x, y] = on(angle, radius * 1.24);
        ctx.fillText(["0°", "90°", "180°", "−90°"][i / 3], x, y);
      }
    }
    path([project([0, 0, 0]), project([0, 0, z])], colours.base, 2);
    if (modelYaw !== null) path([project([0, 0, z]), on(modelYaw, radius)], colours.model, 2, [5, 3]);
    path([project([0, 0, z]), on(yaw, radius)], colours.measured, 2.5);
  }

  shadow(ctx, project, line, colours, reach) {
    ctx.beginPath();
    line.forEach(([x, y], i) => {
      const [u, v] = project([x, y, -1.1 * reach]);
      if (i) ctx.lineTo(u, v);
      else ctx.moveTo(u, v);
    });
    ctx.strokeStyle = colours.grid;
    ctx.lineWidth = 4;
    ctx.lineCap = ctx.lineJoin = "round";
    ctx.stroke();
  }

  /** A round rod along a line, piece by piece: a dark rim, the colour, and a highlight. */
  tube(parts, ctx, project, line, colour, radius) {
    const points = line.map(project);
    const tones = [biflag.shade(colour, 0.55), colour, biflag.shade(colour, 1.35)];
    for (let i = 0; i + 1 < points.length; i++) {
      const [a, b] = [points[i], points[i + 1]];
      const thick = 2 * radius * 0.5 * (a[3] + b[3]);
      // Pieces overlap, so that no rim shows between them.
      const lap = 0.6 / (Math.hypot(b[0] - a[0], b[1] - a[1]) || 1);
      const [dx, dy] = [lap * (b[0] - a[0]), lap * (b[1] - a[1])];
      const isEnd = i === 0 || i + 2 === points.length;
      parts.push({ depth: 0.5 * (a[2] + b[2]), paint: () => {
        ctx.lineCap = isEnd ? "round" : "butt";
        tones.forEach((tone, n) => {
          const lift = n === 2 ? -0.17 * thick : 0;
          ctx.beginPath();
          ctx.moveTo(a[0] - dx + lift, a[1] - dy + lift);
          ctx.lineTo(b[0] + dx + lift, b[1] + dy + lift);
          ctx.strokeStyle = tone;
          ctx.lineWidth = thick * [1, 0.8, 0.22][n];
          ctx.stroke();
        });
        ctx.lineCap = "butt";
      } });
    }
  }

  turn(azimuth, elevation) {
    this.view.azimuth += azimuth;
    this.view.elevation = Math.min(Math.max(this.view.elevation + elevation, -1.4), 1.4);
    this.trial.redraw();
  }

  zoom(factor) {
    this.view.zoom = Math.min(Math.max(this.view.zoom * factor, 0.5), 6);
    this.trial.redraw();
  }

  home() {
    this.view = { ...biflag.Scene.HOME };
    this.trial.redraw();
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
    canvas.addEventListener("dblclick", () => this.home());
    const keys = {
      ArrowLeft: () => this.turn(0.1, 0),
      ArrowRight: () => this.turn(-0.1, 0),
      ArrowUp: () => this.turn(0, 0.1),
      ArrowDown: () => this.turn(0, -0.1),
      "+": () => this.zoom(1.2),
      "=": () => this.zoom(1.2),
      "-": () => this.zoom(1 / 1.2),
      Home: () => this.home(),
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

/** Body to world: roll, then pitch, then yaw. */
biflag.rotation = ([yaw, pitch, roll]) => {
  const [cy, sy, cp, sp, cr, sr] = [yaw, pitch, roll].flatMap((a) => [Math.cos(a), Math.sin(a)]);
  return ([x, y, z]) => [
    cy * cp * x + (cy * sp * sr - sy * cr) * y + (cy * sp * cr + sy * sr) * z,
    sy * cp * x + (sy * sp * sr + cy * cr) * y + (sy * sp * cr - cy * sr) * z,
    -sp * x + cp * sr * y + cp * cr * z,
  ];
};

/** Adds points on a Catmull-Rom spline through the given ones. */
biflag.smooth = (points, pieces) => {
  const smooth = [];
  for (let i = 0; i + 1 < points.length; i++) {
    const [b, c] = [points[i], points[i + 1]];
    const [a, d] = [points[i - 1] ?? b, points[i + 2] ?? c];
    for (let n = 0; n < pieces; n++) {
      const t = n / pieces;
      smooth.push(b.map((v, k) => 0.5 * (2 * v + (c[k] - a[k]) * t + (2 * a[k] - 5 * v + 4 * c[k] - d[k]) * t * t + (3 * v - a[k] - 3 * c[k] + d[k]) * t * t * t)));
    }
  }
  smooth.push(points[points.length - 1]);
  return smooth;
};

/** Brightness of a face that is lit from above and the side. */
biflag.light = (corners, turn) => {
  const [a, b, c] = corners.map(turn);
  const [u, v] = [b.map((x, i) => x - a[i]), c.map((x, i) => x - a[i])];
  const normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
  const length = Math.hypot(...normal) || 1;
  return 0.86 + (0.3 * (normal[0] * -0.35 + normal[1] * -0.5 + normal[2] * 0.79)) / length;
};

/** A colour, darker below 1 and lighter above. */
biflag.shade = (colour, light) => {
  const parts = [1, 3, 5].map((i) => parseInt(colour.slice(i, i + 2), 16));
  const shaded = parts.map((p) => Math.round(light <= 1 ? p * light : p + (255 - p) * Math.min(1, light - 1)));
  return `rgb(${shaded.join(" ")})`;
};
