// Solids by WebGL 2. All views of a page share one context, because browsers allow few: each draws the picture onto its own
// canvas, which also prints.
"use strict";

/** The most lights of contacts. */
biflag.LIGHTS = 12;

biflag.Renderer = class {
  static VERTEX = `#version 300 es
    in vec3 position; in vec3 normal; in vec3 colour;
    uniform mat4 camera; uniform mat3 turn;
    out vec3 n; out vec3 c; out vec3 w;
    void main() {
      n = turn * normal;
      c = colour;
      w = turn * position;
      gl_Position = camera * vec4(w, 1.0);
    }`;

  // A key light and a sky, a gloss, and darker rims; lights where the flagella touch. A ghost is clearer where it is seen face on.
  static FRAGMENT = `#version 300 es
    precision highp float;
    in vec3 n; in vec3 c; in vec3 w;
    uniform vec3 eye; uniform vec3 light; uniform bool ghost;
    uniform vec3 lights[${biflag.LIGHTS}]; uniform int count; uniform vec3 spark; uniform float reach;
    out vec4 shown;
    void main() {
      vec3 m = normalize(n);
      float facing = dot(m, eye);
      if (facing < 0.0) { m = -m; facing = -facing; }
      float key = max(dot(m, light), 0.0);
      float gloss = pow(max(dot(m, normalize(light + eye)), 0.0), 48.0);
      vec3 lit = c * (0.5 + 0.12 * m.z + 0.5 * key) + 0.22 * gloss;
      lit *= 1.0 - 0.45 * pow(1.0 - facing, 3.0);
      float glow = 0.0;
      for (int i = 0; i < count; i++) { vec3 d = (w - lights[i]) / reach; glow = max(glow, exp(-dot(d, d))); }
      lit = mix(lit, spark + 0.25 * gloss, 0.85 * glow);
      float alpha = ghost ? mix(0.62, 0.26, facing) : 1.0;
      shown = vec4(lit * alpha, alpha);
    }`;

  static shared() {
    biflag.renderer ??= new biflag.Renderer();
    return biflag.renderer;
  }

  constructor() {
    this.canvas = new OffscreenCanvas(1, 1);
    this.gl = this.canvas.getContext("webgl2", { antialias: true });
    if (this.gl) this.prepare();
    this.canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    this.canvas.addEventListener("webglcontextrestored", () => this.prepare());
  }

  /** Whether the browser draws solids; if not, a scene draws lines. */
  get works() {
    return this.gl !== null && !this.gl.isContextLost();
  }

  prepare() {
    const { gl } = this;
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, biflag.Renderer.VERTEX], [gl.FRAGMENT_SHADER, biflag.Renderer.FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    gl.useProgram(program);
    this.uniforms = Object.fromEntries(
      ["camera", "turn", "eye", "light", "ghost", "lights", "count", "spark", "reach"].map((name) => [name, gl.getUniformLocation(program, name)]),
    );
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    // Three vectors a corner: place, normal, colour.
    for (const [i, name] of ["position", "normal", "colour"].entries()) {
      const place = gl.getAttribLocation(program, name);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 36, 12 * i);
    }
    gl.enable(gl.DEPTH_TEST);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  }

  /**
   * Draws `solids` (a mesh, its rotation as nine numbers by columns, whether it is a ghost, and whether the lights shine on it);
   * returns the picture. `lights` have places in world axes, a colour and a reach.
   */
  draw(width, height, { camera, eye, light }, solids, lights) {
    const { gl, canvas, uniforms } = this;
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.uniformMatrix4fv(uniforms.camera, false, camera);
    gl.uniform3fv(uniforms.eye, eye);
    gl.uniform3fv(uniforms.light, light);
    const places = lights.places.slice(0, biflag.LIGHTS);
    if (places.length) gl.uniform3fv(uniforms.lights, places.flat());
    gl.uniform3fv(uniforms.spark, lights.colour);
    gl.uniform1f(uniforms.reach, lights.reach);
    for (const { mesh, turn, ghost, glows } of solids) {
      const { corners, faces } = mesh.arrays();
      if (!faces.length) continue;
      gl.uniform1i(uniforms.count, glows ? places.length : 0);
      gl.bufferData(gl.ARRAY_BUFFER, corners, gl.DYNAMIC_DRAW);
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, faces, gl.DYNAMIC_DRAW);
      gl.uniformMatrix3fv(uniforms.turn, false, turn);
      gl.uniform1i(uniforms.ghost, ghost ? 1 : 0);
      const paint = () => gl.drawElements(gl.TRIANGLES, faces.length, gl.UNSIGNED_INT, 0);
      if (!ghost) {
        gl.disable(gl.BLEND);
        gl.depthFunc(gl.LESS);
        paint();
        continue;
      }
      // Only the nearest faces of a ghost are painted: its own far side does not show through.
      gl.colorMask(false, false, false, false);
      gl.depthFunc(gl.LESS);
      paint();
      gl.colorMask(true, true, true, true);
      gl.enable(gl.BLEND);
      gl.depthFunc(gl.EQUAL);
      paint();
    }
    return canvas.transferToImageBitmap();
  }
};
