// @ts-check
// A camera that orbits a point, moved by pointer, wheel and keys. The z axis points up.

/**
 * The product of two 4 × 4 matrices in column-major order.
 * @param {ArrayLike<number>} a @param {ArrayLike<number>} b
 */
function product(a, b) {
  return Float32Array.from({ length: 16 }, (_, i) => [0, 1, 2, 3].reduce((sum, k) => sum + a[4 * k + (i % 4)] * b[4 * Math.floor(i / 4) + k], 0));
}

/** @param {number[]} a @param {number[]} b */
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
/** @param {number[]} a @param {number[]} b */
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
/** @param {number[]} a */
const unit = (a) => a.map((x) => x / Math.hypot(...a));

/**
 * A camera at the box from `low` to `high`, in metres. `moved` is called after every change of the view.
 * @param {HTMLCanvasElement} canvas @param {number[]} low @param {number[]} high @param {() => void} moved
 */
export function camera(canvas, low, high, moved) {
  const centre = low.map((x, i) => (x + high[i]) / 2), radius = Math.hypot(...low.map((x, i) => high[i] - x)) / 2;
  const home = { azimuth: -1.1, elevation: 0.35, distance: 2.6 * radius, target: centre };
  let pose = { ...home };
  const axes = () => {
    const { azimuth, elevation } = pose;
    const back = [Math.cos(elevation) * Math.cos(azimuth), Math.cos(elevation) * Math.sin(azimuth), Math.sin(elevation)];
    const right = unit(cross([0, 0, 1], back));
    return { back, right, up: cross(back, right) };
  };
  const turn = (/** @type {number} */ across, /** @type {number} */ up) => change({ azimuth: pose.azimuth - across, elevation: Math.min(1.55, Math.max(-1.55, pose.elevation + up)) });
  const shift = (/** @type {number} */ across, /** @type {number} */ up) => {
    const { right, up: upward } = axes();
    change({ target: pose.target.map((x, i) => x - pose.distance * (across * right[i] - up * upward[i])) });
  };
  const zoom = (/** @type {number} */ by) => change({ distance: Math.min(12 * radius, Math.max(0.05 * radius, pose.distance * by)) });
  /** @param {Partial<typeof pose>} to */
  function change(to) {
    pose = { ...pose, ...to };
    moved();
  }

  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    const move = (/** @type {PointerEvent} */ event) => {
      const [dx, dy] = [event.movementX, event.movementY].map((pixels) => pixels / canvas.clientHeight);
      if (event.shiftKey || event.buttons & 2) shift(dx, dy);
      else turn(4 * dx, 4 * dy);
    };
    canvas.addEventListener("pointermove", move);
    canvas.addEventListener("pointerup", () => canvas.removeEventListener("pointermove", move), { once: true });
  });
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom(Math.exp(event.deltaY / 600));
  }, { passive: false });
  /** @type {Record<string, () => void>} */
  const keys = {
    ArrowLeft: () => turn(-0.1, 0), ArrowRight: () => turn(0.1, 0), ArrowUp: () => turn(0, 0.1), ArrowDown: () => turn(0, -0.1),
    "+": () => zoom(0.9), "-": () => zoom(1 / 0.9), Home: () => change(home),
  };
  canvas.addEventListener("keydown", (event) => {
    const move = keys[event.key];
    if (!move) return;
    event.preventDefault();
    move();
  });

  /**
   * View and projection for an image of this aspect ratio.
   * @param {number} aspect
   */
  function matrices(aspect) {
    const { back, right, up } = axes();
    const eye = pose.target.map((x, i) => x + pose.distance * back[i]);
    const view = [right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0, -dot(right, eye), -dot(up, eye), -dot(back, eye), 1];
    const near = 0.02 * pose.distance, far = pose.distance + 8 * radius, f = 1 / Math.tan(0.35);
    const projection = [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, (2 * far * near) / (near - far), 0];
    return { view: Float32Array.from(view), projection: Float32Array.from(projection), both: product(projection, view) };
  }
  const asText = () => [pose.azimuth, pose.elevation, pose.distance / radius].map((x) => x.toFixed(2)).join(",");
  const set = (/** @type {string} */ text) => {
    const [azimuth, elevation, distance] = text.split(",").map(Number);
    if ([azimuth, elevation, distance].every(Number.isFinite)) change({ azimuth, elevation, distance: distance * radius });
  };
  return { matrices, asText, set };
}
