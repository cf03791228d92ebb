// Triangles of round and square bodies. Lengths are in metres, colours are red, green and blue from 0 to 1.
"use strict";

biflag.Mesh = class {
  constructor() {
    this.numbers = [];
    this.triangles = [];
  }

  /** The numbers of all corners, and the corners of each triangle. */
  arrays() {
    this.packed ??= { corners: new Float32Array(this.numbers), faces: new Uint32Array(this.triangles) };
    return this.packed;
  }

  corner(place, normal, colour) {
    this.numbers.push(...place, ...normal, ...colour);
    return this.numbers.length / 9 - 1;
  }

  square(a, b, c, d) {
    this.triangles.push(a, b, c, a, c, d);
  }

  /** Turns a profile of radii and heights about an axis; its edges stay sharp. */
  lathe(base, axis, profile, colour, sides) {
    const [u, v] = biflag.across(axis);
    const on = (angle, radius, height) => base.map((x, i) => x + radius * (Math.cos(angle) * u[i] + Math.sin(angle) * v[i]) + height * axis[i]);
    for (let k = 0; k + 1 < profile.length; k++) {
      const [[r0, h0], [r1, h1]] = [profile[k], profile[k + 1]];
      const length = Math.hypot(r1 - r0, h1 - h0);
      if (length < 1e-9) continue;
      const [out, up] = [(h1 - h0) / length, (r0 - r1) / length];
      const rings = Array.from({ length: sides + 1 }, (_, i) => {
        const angle = (2 * Math.PI * i) / sides;
        const normal = axis.map((x, j) => out * (Math.cos(angle) * u[j] + Math.sin(angle) * v[j]) + up * x);
        return [this.corner(on(angle, r0, h0), normal, colour), this.corner(on(angle, r1, h1), normal, colour)];
      });
      for (let i = 0; i < sides; i++) this.square(rings[i][0], rings[i + 1][0], rings[i + 1][1], rings[i][1]);
    }
  }

  /** A cylinder along z with bevelled edges. */
  cylinder([x, y], radius, low, high, colour, sides) {
    const bevel = Math.min(0.12 * radius, 0.2 * (high - low));
    const profile = [[0, 0], [radius - bevel, 0], [radius, bevel], [radius, high - low - bevel], [radius - bevel, high - low], [0, high - low]];
    this.lathe([x, y, low], [0, 0, 1], profile, colour, sides);
  }

  box(from, to, colour) {
    for (const axis of [0, 1, 2]) {
      const [p, q] = [(axis + 1) % 3, (axis + 2) % 3];
      for (const end of [from, to]) {
        const normal = [0, 0, 0];
        normal[axis] = end === to ? 1 : -1;
        const corners = [[0, 0], [1, 0], [1, 1], [0, 1]].map(([a, b]) => {
          const place = [...end];
          place[p] = a ? to[p] : from[p];
          place[q] = b ? to[q] : from[q];
          return this.corner(place, normal, colour);
        });
        this.square(...corners);
      }
    }
  }

  /** A round rod along a line, with rounded ends. Its cross-sections turn as little as they can. `radius` may vary by point. */
  tube(line, radius, colour, sides = 12) {
    const radiusAt = typeof radius === "function" ? radius : () => radius;
    const tangent = (i) => biflag.unit(biflag.minus(line[Math.min(i + 1, line.length - 1)], line[Math.max(i - 1, 0)]));
    let [u] = biflag.across(tangent(0));
    let last = null;
    const ring = (centre, along, r, lean) => {
      const v = biflag.cross(along, u);
      const corners = Array.from({ length: sides }, (_, i) => {
        const angle = (2 * Math.PI * i) / sides;
        const out = u.map((x, k) => Math.cos(angle) * x + Math.sin(angle) * v[k]);
        const normal = out.map((x, k) => x * Math.cos(lean) + along[k] * Math.sin(lean));
        return this.corner(centre.map((x, k) => x + r * out[k]), normal, colour);
      });
      if (last) corners.forEach((corner, i) => this.square(last[i], last[(i + 1) % sides], corners[(i + 1) % sides], corner));
      last = corners;
    };
    const cap = (centre, along, end, radius) => {
      const leans = [90, 60, 30].map((degrees) => (end * degrees * Math.PI) / 180);
      for (const lean of end < 0 ? leans : leans.reverse()) {
        ring(centre.map((x, k) => x + radius * Math.sin(lean) * along[k]), along, radius * Math.cos(lean), lean);
      }
    };
    for (const [i, centre] of line.entries()) {
      const along = tangent(i);
      const slip = biflag.dot(u, along);
      u = biflag.unit(u.map((x, k) => x - slip * along[k]));
      if (i === 0) cap(centre, along, -1, radiusAt(i));
      ring(centre, along, radiusAt(i), 0);
      if (i === line.length - 1) cap(centre, along, 1, radiusAt(i));
    }
  }

  /** An arrow of a length that includes its head; short ones are all head. */
  arrow(from, vector, radius, colour) {
    const length = Math.hypot(...vector);
    if (length < 1e-6) return;
    const head = Math.min(5 * radius, length);
    const width = (2.4 * radius * head) / (5 * radius);
    const shaft = Math.min(radius, width);
    this.lathe(from, vector.map((x) => x / length), [[0, 0], [shaft, 0], [shaft, length - head], [width, length - head], [0, length]], colour, 14);
  }
};

biflag.dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
biflag.minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
biflag.cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
biflag.unit = (a) => {
  const length = Math.hypot(...a) || 1;
  return a.map((x) => x / length);
};

/** Two directions across an axis; the three are right-handed. */
biflag.across = (axis) => {
  const other = Math.abs(axis[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0];
  const u = biflag.unit(biflag.cross(other, axis));
  return [u, biflag.cross(axis, u)];
};

/** Body to world as nine numbers by columns: roll, then pitch, then yaw (radians). */
biflag.rotation = ([yaw, pitch, roll]) => {
  const [cy, sy, cp, sp, cr, sr] = [yaw, pitch, roll].flatMap((a) => [Math.cos(a), Math.sin(a)]);
  return [
    cy * cp, sy * cp, -sp,
    cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr,
    cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr,
  ];
};

biflag.turned = (m, [x, y, z]) => [0, 1, 2].map((i) => m[i] * x + m[3 + i] * y + m[6 + i] * z);

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

/**
 * Places between two lines where they are no farther apart than `reach`, with a tolerance for what the page rounds and
 * interpolates: the nearest pairs of points, each some way from the others. Without any, the nearest pair of all.
 */
biflag.touching = ([one, two], reach) => {
  const near = [];
  let least = Infinity;
  let closest = null;
  for (const a of one) {
    for (const b of two) {
      const square = (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2;
      const pair = () => ({ square, place: [0, 1, 2].map((i) => (a[i] + b[i]) / 2) });
      if (square < (1.12 * reach) ** 2) near.push(pair());
      else if (square < least) [least, closest] = [square, pair()];
    }
  }
  near.sort((a, b) => a.square - b.square);
  const kept = [];
  for (const { place } of near) {
    if (kept.length === biflag.LIGHTS) break;
    if (kept.every((other) => Math.hypot(...biflag.minus(place, other)) > 1.5 * reach)) kept.push(place);
  }
  return kept.length || !closest ? kept : [closest.place];
};

/** A colour of the page as three numbers from 0 to 1. */
biflag.rgb = (name) => {
  const colour = biflag.colour(name);
  return [1, 3, 5].map((i) => parseInt(colour.slice(i, i + 2), 16) / 255);
};
