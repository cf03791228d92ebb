// The box of glycerin about the robot: what is behind the robot, its floor with soft shadows, and what is before it. World axes
// from the joint, in metres.
"use strict";

biflag.Tank = class {
  /** A box for a robot whose file names no tank: a little larger than the robot, to show the surface and the floor. */
  static about({ height_m, length_m }) {
    const reach = height_m + length_m;
    return { low_m: [-0.36 * reach, -0.36 * reach, -1.12 * reach], high_m: [0.36 * reach, 0.36 * reach, 0.2 * reach] };
  }

  /** What a view must show for the whole tank: its middle, and its size along the view's directions. */
  static frame({ low_m, high_m }, right, up) {
    const size = high_m.map((high, axis) => high - low_m[axis]);
    const along = (direction) => direction.reduce((sum, part, axis) => sum + Math.abs(part) * size[axis], 0);
    // Near corners look larger.
    const [wide, tall] = [right, up].map((direction) => 1.12 * along(direction));
    return { middle: high_m.map((high, axis) => high - size[axis] / 2), reach: Math.hypot(...size), wide, tall };
  }

  /** `view`: the canvas and its projection (see scene.js). */
  constructor({ low_m, high_m }, view, css) {
    Object.assign(this, { low: low_m, high: high_m, view, css });
    // The sides away from the camera are behind the robot.
    this.sides = [0, 1].flatMap((axis) => [-1, 1].map((sign) => ({ axis, sign, isBehind: sign * view.away[axis] > 0 })));
    this.fromAbove = view.away[2] < 0;
  }

  /** The corners of a side (axis 0 or 1), or of the floor or the surface (axis 2). */
  face(axis, sign) {
    const [p, q] = axis === 2 ? [0, 1] : [1 - axis, 2];
    return [[0, 0], [1, 0], [1, 1], [0, 1]].map(([a, b]) => {
      const place = [0, 0, 0];
      place[axis] = sign > 0 ? this.high[axis] : this.low[axis];
      place[p] = a ? this.high[p] : this.low[p];
      place[q] = b ? this.high[q] : this.low[q];
      return place;
    });
  }

  /** Fills a face, and draws its edges: faintly before the robot. */
  paint(axis, sign, strength, edges = 0.5) {
    const { ctx, project } = this.view;
    const corners = this.face(axis, sign).map((corner) => project(corner));
    ctx.beginPath();
    for (const [x, y] of corners) ctx.lineTo(x, y);
    ctx.closePath();
    ctx.fillStyle = ctx.strokeStyle = this.css.glycerin;
    ctx.globalAlpha = strength;
    ctx.fill();
    ctx.globalAlpha = edges;
    ctx.lineWidth = 0.8;
    ctx.stroke();
    ctx.globalAlpha = 1;
  }

  behind() {
    this.paint(2, this.fromAbove ? -1 : 1, 0.14);
    for (const { axis, sign, isBehind } of this.sides) if (isBehind) this.paint(axis, sign, 0.09);
  }

  before() {
    for (const { axis, sign, isBehind } of this.sides) if (!isBehind) this.paint(axis, sign, 0.035, 0.15);
    this.paint(2, this.fromAbove ? 1 : -1, 0.08);
  }

  /** Shadows of the flagella and the base on the floor, by a light high above; soft by several strokes. */
  shadows(lines, { rod_radius_m: rod, radius_m: base }) {
    if (!this.fromAbove) return;
    const { ctx, project, scale } = this.view;
    const floor = this.low[2];
    const onFloor = (points) => {
      ctx.beginPath();
      for (const [x, y] of points) ctx.lineTo(...project([x, y, floor]).slice(0, 2));
    };
    ctx.save();
    ctx.lineCap = ctx.lineJoin = "round";
    ctx.strokeStyle = ctx.fillStyle = this.css.shadow;
    ctx.globalAlpha = 0.035;
    for (let width = 9; width > 0.5; width -= 0.85) {
      ctx.lineWidth = width * rod * scale;
      for (const line of lines) {
        onFloor(line);
        ctx.stroke();
      }
      onFloor(Array.from({ length: 32 }, (_, i) => [Math.cos((i * Math.PI) / 16), Math.sin((i * Math.PI) / 16)].map((part) => part * (base + 0.5 * width * rod))));
      ctx.fill();
    }
    ctx.restore();
  }
};
