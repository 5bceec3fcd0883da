// A camera that turns about a point: by drag, wheel and keys. z is up.

/** Product of two 4 × 4 matrices, column by column. */
function times(a, b) {
  return Float32Array.from({ length: 16 }, (_, i) => [0, 1, 2, 3].reduce((sum, k) => sum + a[4 * k + (i % 4)] * b[4 * Math.floor(i / 4) + k], 0));
}

const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const unit = (a) => a.map((x) => x / Math.hypot(...a));

/** Looks at the box from `low` to `high`; `moved` is called when the view has changed. */
export function camera(canvas, low, high, moved) {
  const centre = low.map((x, i) => (x + high[i]) / 2), reach = Math.hypot(...low.map((x, i) => high[i] - x)) / 2;
  const home = { azimuth: -1.1, elevation: 0.35, distance: 2.6 * reach, target: centre };
  let now = { ...home };
  const axes = () => {
    const { azimuth, elevation } = now;
    const back = [Math.cos(elevation) * Math.cos(azimuth), Math.cos(elevation) * Math.sin(azimuth), Math.sin(elevation)];
    const right = unit(cross([0, 0, 1], back));
    return { back, right, up: cross(back, right) };
  };
  const turn = (across, up) => change({ azimuth: now.azimuth - across, elevation: Math.min(1.55, Math.max(-1.55, now.elevation + up)) });
  const shift = (across, up) => {
    const { right, up: upward } = axes();
    change({ target: now.target.map((x, i) => x - now.distance * (across * right[i] - up * upward[i])) });
  };
  const zoom = (by) => change({ distance: Math.min(12 * reach, Math.max(0.05 * reach, now.distance * by)) });
  function change(to) {
    now = { ...now, ...to };
    moved();
  }

  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    const move = (event) => {
      const [dx, dy] = [event.movementX, event.movementY].map((pixels) => pixels / canvas.clientHeight);
      if (event.shiftKey || event.buttons & 2) shift(dx, dy);
      else turn(4 * dx, 4 * dy);
    };
    canvas.addEventListener("pointermove", move);
    canvas.addEventListener("pointerup", () => canvas.removeEventListener("pointermove", move), { once: true });
  });
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => (event.preventDefault(), zoom(Math.exp(event.deltaY / 600))), { passive: false });
  const keys = {
    ArrowLeft: () => turn(-0.1, 0), ArrowRight: () => turn(0.1, 0), ArrowUp: () => turn(0, 0.1), ArrowDown: () => turn(0, -0.1),
    "+": () => zoom(0.9), "-": () => zoom(1 / 0.9), Home: () => change(home),
  };
  canvas.addEventListener("keydown", (event) => keys[event.key] && (event.preventDefault(), keys[event.key]()));

  /** Matrices for a picture of this shape. */
  function matrices(aspect) {
    const { back, right, up } = axes();
    const eye = now.target.map((x, i) => x + now.distance * back[i]);
    const view = [right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0, -dot(right, eye), -dot(up, eye), -dot(back, eye), 1];
    const near = 0.02 * now.distance, far = now.distance + 8 * reach, f = 1 / Math.tan(0.35);
    const projection = [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, (2 * far * near) / (near - far), 0];
    return { view: Float32Array.from(view), projection: Float32Array.from(projection), both: times(projection, view) };
  }
  const told = () => [now.azimuth, now.elevation, now.distance / reach].map((x) => x.toFixed(2)).join(",");
  const set = (text) => {
    const [azimuth, elevation, distance] = text.split(",").map(Number);
    if ([azimuth, elevation, distance].every(Number.isFinite)) change({ azimuth, elevation, distance: distance * reach });
  };
  return { matrices, told, set };
}
