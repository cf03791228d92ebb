// The robot's body and flagella in body axes: z is up, and the robot hangs from the joint at the origin. In the frame of its
// shaft, a flagellum changes slowly: the page stores few shapes in that frame and turns them with the shaft.
"use strict";

/** So many shapes in a turn of the shaft show the path of a tip. */
const SHAPES_A_TURN = 6;

biflag.Robot = class {
  constructor({ shift_s, turns, shapes, body, tank }) {
    this.shift = shift_s;
    this.body = body;
    this.tank = tank ?? biflag.Tank.about(body);
    this.turns = biflag.table(turns);
    const numbers = new Int16Array(biflag.bytes(shapes.i16));
    this.shapes = { ...shapes, time: biflag.numbers(shapes.time), numbers, each: shapes.nodes * 3 };
    this.feet = shapes.feet_m;
  }

  get reach() {
    return this.body.height_m + this.body.length_m;
  }

  /** Centre line of flagellum `k` at a time of the page. */
  line(k, time) {
    const at = this.node(k, time);
    return biflag.smooth(Array.from({ length: this.shapes.nodes }, (_, n) => at(n)), this.shapes.nodes > 40 ? 2 : 4);
  }

  /** The tip of flagellum `k` at a time of the page. */
  tip(k, time) {
    return this.node(k, time)(this.shapes.nodes - 1);
  }

  /**
   * Times of the points of a trail. Between two shapes, a tip that its shaft does not carry along, as in a bundle, is not where
   * the frame of the shaft has it: if the log has enough shapes in a turn, the points are at these, otherwise evenly spaced.
   */
  trailTimes(from, to, points) {
    const { shapes, turns } = this;
    const span = (column) => Math.abs((biflag.at(turns.time, column, to - this.shift) ?? 0) - (biflag.at(turns.time, column, from - this.shift) ?? 0));
    const at = shapes.time.map((t) => t + this.shift).filter((t) => t > from && t < to);
    if (!shapes.rigid && at.length >= SHAPES_A_TURN * Math.max(span(turns.one), span(turns.two))) return [from, ...at, to];
    return Array.from({ length: points }, (_, i) => from + ((to - from) * i) / (points - 1));
  }

  /** A function that returns a node of flagellum `k` at a time of the page. */
  node(k, time) {
    const { shapes, turns } = this;
    const t = time - this.shift;
    const i = biflag.before(shapes.time, t);
    const j = Math.min(i + 1, shapes.time.length - 1);
    const share = j > i ? Math.min(Math.max((t - shapes.time[i]) / (shapes.time[j] - shapes.time[i]), 0), 1) : 0;
    const angle = 2 * Math.PI * (biflag.at(turns.time, k ? turns.two : turns.one, t) ?? 0);
    const [c, s] = [Math.cos(angle), Math.sin(angle)];
    const foot = this.feet[k];
    const part = (frame, n, axis) => shapes.numbers[(2 * frame + k) * shapes.each + 3 * n + axis];
    return (n) => {
      const [x, y, z] = [0, 1, 2].map((axis) => shapes.unit_m * (part(i, n, axis) * (1 - share) + part(j, n, axis) * share));
      return [foot[0] + c * x - s * y, foot[1] + s * x + c * y, foot[2] + z];
    };
  }

  /** The joint, the base, the motors and their brackets. `colour` turns a name into a colour. */
  base(colour) {
    const { radius_m: radius, height_m: height } = this.body;
    const mesh = new biflag.Mesh();
    const grey = colour("base");
    mesh.cylinder([0, 0], radius, -height, 0, grey, 48);
    const ball = Array.from({ length: 9 }, (_, i) => [0.3 * radius * Math.sin((i * Math.PI) / 8), -0.3 * radius * Math.cos((i * Math.PI) / 8)]);
    mesh.lathe([0, 0, 0.2 * radius], [0, 0, 1], ball, grey, 24);
    for (const [k, [x]] of this.feet.entries()) {
      mesh.cylinder([x, 0], 0.42 * radius, -height, -0.2 * height, colour(`flagellum${k + 1}`), 28);
      const side = Math.sign(x) || 1;
      const [a, b] = [side * 0.9 * radius, x - side * 0.3 * radius].sort((p, q) => p - q);
      for (const z of [-0.85 * height, -0.4 * height]) {
        if (b > a) mesh.box([a, -0.25 * radius, z - 0.09 * height], [b, 0.25 * radius, z + 0.09 * height], grey);
      }
    }
    return mesh;
  }

  /** Both flagella with their shafts. */
  rods(lines, colour) {
    const mesh = new biflag.Mesh();
    for (const [k, line] of lines.entries()) {
      mesh.tube([this.feet[k], line[0]], 0.5 * this.body.rod_radius_m, colour("base"));
      mesh.tube(line, this.body.rod_radius_m, colour(`flagellum${k + 1}`));
    }
    return mesh;
  }

  /** The forces of the flagella on the base (mN, or null), each beside the foot of its shaft. */
  arrows(forces, metres_per_mn, colour) {
    const mesh = new biflag.Mesh();
    for (const [k, force] of forces.entries()) {
      if (force.includes(null)) continue;
      mesh.arrow(this.foot(k), force.map((part) => part * metres_per_mn), 0.7 * this.body.rod_radius_m, colour("force"));
    }
    return mesh;
  }

  /** Where the arrow of a force begins. */
  foot(k) {
    const [x, y, z] = this.feet[k];
    return [x + (Math.sign(x) || 1) * 0.9 * this.body.radius_m, y, z];
  }
};
