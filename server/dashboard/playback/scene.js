// @ts-check
// Drawing of playback with WebGL2: transparent equipment, and an instance per sphere. A sphere is a square that faces the camera; the fragment
// shader gives it the shading and the depth of a sphere.

const SPHERES = {
  vertex: `#version 300 es
    uniform mat4 view, projection; uniform float radius; uniform int colouring;
    in vec2 corner; in vec3 centre; in float value;
    out vec2 disc; out vec3 position; out vec3 tint;
    vec3 ofBody(float body) { // hues a golden angle apart
      float hue = fract(body * 0.61803399), light = 0.72 + 0.16 * fract(body * 0.381966);
      return light * (0.55 + 0.45 * cos(6.2831853 * (hue + vec3(0.0, 0.33, 0.67))));
    }
    vec3 ofShare(float x) { // Turbo, as a polynomial (A. Mikhailov, 2019)
      x = clamp(x, 0.0, 1.0);
      vec4 v = vec4(1.0, x, x * x, x * x * x); vec2 w = v.zw * v.z;
      return clamp(vec3(dot(v, vec4(0.13572138, 4.61539260, -42.66032258, 132.13108234)) + dot(w, vec2(-152.94239396, 59.28637943)),
        dot(v, vec4(0.09140261, 2.19418839, 4.84296658, -14.18503333)) + dot(w, vec2(4.27729857, 2.82956604)),
        dot(v, vec4(0.10667330, 12.64194608, -60.58204836, 110.36276771)) + dot(w, vec2(-89.90310912, 27.34824973))), 0.0, 1.0);
    }
    void main() {
      vec4 eye = view * vec4(centre, 1.0);
      position = eye.xyz; disc = corner;
      tint = colouring == 0 ? ofBody(value) : ofShare(mix(0.08, 0.95, value)); // Turbo's ends are nearly black
      gl_Position = projection * (eye + vec4(radius * corner, 0.0, 0.0));
    }`,
  fragment: `#version 300 es
    precision highp float;
    uniform mat4 projection; uniform float radius;
    in vec2 disc; in vec3 position; in vec3 tint;
    out vec4 colour;
    void main() {
      float out2 = dot(disc, disc);
      if (out2 > 1.0) discard;
      vec3 normal = vec3(disc, sqrt(1.0 - out2));
      vec4 clip = projection * vec4(position + radius * normal, 1.0);
      gl_FragDepth = 0.5 * clip.z / clip.w + 0.5;
      float light = 0.35 + 0.65 * max(0.0, dot(normal, normalize(vec3(0.4, 0.7, 0.6))));
      colour = vec4(tint * light, 1.0);
    }`,
};

const SURFACES = {
  vertex: `#version 300 es
    uniform mat4 view, projection;
    in vec3 corner; in vec3 normal; out vec3 facing;
    void main() { facing = mat3(view) * normal; gl_Position = projection * view * vec4(corner, 1.0); }`,
  fragment: `#version 300 es
    precision highp float;
    uniform vec4 tint; in vec3 facing; out vec4 colour;
    void main() { colour = vec4(tint.rgb * (0.55 + 0.45 * abs(normalize(facing).z)), tint.a); }`,
};

/** @param {WebGL2RenderingContext} gl @param {{ vertex: string, fragment: string }} sources */
function program(gl, { vertex, fragment }) {
  const made = gl.createProgram();
  for (const [kind, source] of /** @type {[GLenum, string][]} */ ([[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]])) {
    const shader = /** @type {WebGLShader} */ (gl.createShader(kind));
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader) ?? "a shader does not compile");
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made) ?? "the shaders do not link");
  return { made, uniform: (/** @type {string} */ name) => gl.getUniformLocation(made, name), attribute: (/** @type {string} */ name) => gl.getAttribLocation(made, name) };
}

/**
 * The corners of a surface at belt time t. Motion begins at t = 0 (docs/frames.md).
 * @param {FrameSurface} surface @param {number} t_s @returns {number[][]}
 */
function placed(surface, t_s) {
  const corners = surface.triangles_m.flat();
  const motion = surface.motion;
  if (motion.kind !== "moving" || !(t_s > 0)) return corners;
  const spin = motion.spin_rad_s ?? [0, 0, 0], rate = Math.hypot(...spin), angle = rate * t_s;
  const k = rate > 0 ? spin.map((x) => x / rate) : [0, 0, 1], pivot = motion.pivot_m ?? [0, 0, 0], velocity = motion.velocity_m_s ?? [0, 0, 0];
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  return corners.map((corner) => {
    const r = corner.map((x, i) => x - pivot[i]), along = (1 - c) * (k[0] * r[0] + k[1] * r[1] + k[2] * r[2]);
    const across = [k[1] * r[2] - k[2] * r[1], k[2] * r[0] - k[0] * r[2], k[0] * r[1] - k[1] * r[0]];
    return r.map((x, i) => pivot[i] + velocity[i] * t_s + c * x + s * across[i] + along * k[i]);
  });
}

/** Colour and opacity by kind of surface. */
const SURFACE_COLOURS = { belt: [0.35, 0.55, 0.75, 0.55], equipment: [0.75, 0.8, 0.85, 0.2], frictionless: [0.75, 0.8, 0.85, 0.07] };

/** @param {string} kind */
const surfaceColour = (kind) => SURFACE_COLOURS[/** @type {keyof typeof SURFACE_COLOURS} */ (kind)] ?? SURFACE_COLOURS.equipment;

/**
 * Draws the frames of a stream on a canvas.
 * @param {HTMLCanvasElement} canvas @param {FrameHeader} head
 */
export function scene(canvas, head) {
  const context = canvas.getContext("webgl2", { antialias: true });
  if (!context) throw new Error("This browser has no WebGL2, which playback needs.");
  const gl = context;
  const spheres = program(gl, SPHERES), walls = program(gl, SURFACES);
  const buffer = (/** @type {Float32Array<ArrayBuffer> | undefined} */ data = undefined) => {
    const made = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, made);
    if (data) gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
    return made;
  };
  /** @param {number} place @param {WebGLBuffer} buffer @param {number} size @param {number} stride @param {number} offset @param {number} divisor */
  const attribute = (place, buffer, size, stride, offset, divisor) => {
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, size, gl.FLOAT, false, stride, offset);
    gl.vertexAttribDivisor(place, divisor);
  };
  const sphere_array = gl.createVertexArray(), [centres, values] = [buffer(), buffer()];
  gl.bindVertexArray(sphere_array);
  attribute(spheres.attribute("corner"), buffer(new Float32Array([-1, -1, 1, -1, -1, 1, 1, 1])), 2, 0, 0, 0);
  attribute(spheres.attribute("centre"), centres, 3, 0, 0, 1);
  attribute(spheres.attribute("value"), values, 1, 0, 0, 1);
  const surface_array = gl.createVertexArray(), corners = buffer();
  gl.bindVertexArray(surface_array);
  attribute(walls.attribute("corner"), corners, 3, 24, 0, 0);
  attribute(walls.attribute("normal"), corners, 3, 24, 12, 0);
  let count = 0;
  /** @type {{ colour: number[], from: number, count: number }[]} */
  let groups = [];

  /**
   * Loads a frame. `value` colours its sub-particles.
   * @param {Frame} frame @param {Float32Array} value @param {FrameSurface[]} surfaces
   */
  function load(frame, value, surfaces) {
    count = frame.count;
    for (const [target, data] of /** @type {[WebGLBuffer, Float32Array<ArrayBuffer>][]} */ ([[centres, frame.positions], [values, value]])) {
      gl.bindBuffer(gl.ARRAY_BUFFER, target);
      gl.bufferData(gl.ARRAY_BUFFER, data, gl.DYNAMIC_DRAW);
    }
    /** @type {number[]} */
    const data = [];
    // The most opaque first: the others blend over it.
    const shown = surfaces.filter((one) => one.presence === "always" || !(frame.t_s >= 0)).sort((a, b) => surfaceColour(b.kind)[3] - surfaceColour(a.kind)[3]);
    groups = shown.map((surface) => {
      const points = placed(surface, frame.t_s), from = data.length / 6;
      for (let i = 0; i < points.length; i += 3) {
        const [a, b, c] = [points[i], points[i + 1], points[i + 2]];
        const [u, v] = [b.map((x, k) => x - a[k]), c.map((x, k) => x - a[k])];
        const normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        for (const point of [a, b, c]) data.push(...point, ...normal);
      }
      return { colour: surfaceColour(surface.kind), from, count: data.length / 6 - from };
    });
    gl.bindBuffer(gl.ARRAY_BUFFER, corners);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(data), gl.DYNAMIC_DRAW);
  }

  /** @param {{ view: Float32Array, projection: Float32Array }} camera @param {number} colouring 0 by body, 1 by value */
  function draw({ view, projection }, colouring) {
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0.063, 0.082, 0.102, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    const use = (/** @type {ReturnType<typeof program>} */ { made, uniform }) => {
      gl.useProgram(made);
      gl.uniformMatrix4fv(uniform("view"), false, view);
      gl.uniformMatrix4fv(uniform("projection"), false, projection);
    };
    use(spheres);
    gl.uniform1f(spheres.uniform("radius"), head.radius_m);
    gl.uniform1i(spheres.uniform("colouring"), colouring);
    gl.bindVertexArray(sphere_array);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, count);
    use(walls);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.depthMask(false);
    gl.bindVertexArray(surface_array);
    for (const group of groups) {
      gl.uniform4fv(walls.uniform("tint"), group.colour);
      gl.drawArrays(gl.TRIANGLES, group.from, group.count);
    }
    gl.depthMask(true);
    gl.disable(gl.BLEND);
  }
  return { load, draw };
}
