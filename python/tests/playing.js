// The page of test_playback.py: shows a widget as anywidget does, plays it, and reports what there is to see.

const wait = (ms) => new Promise((done) => setTimeout(done, ms));

async function until(what, found) {
  for (const end = performance.now() + 30_000; performance.now() < end; await wait(20)) {
    const value = found();
    if (value) return value;
  }
  throw new Error(`${what}: not in 30 s`);
}

/** The number of different colours on a canvas. Key and copy come in one turn, before the browser clears the canvas. */
async function colours(canvas) {
  canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowLeft" }));
  await new Promise(requestAnimationFrame);
  const small = new OffscreenCanvas(64, 48), paper = small.getContext("2d");
  paper.drawImage(canvas, 0, 0, 64, 48);
  return new Set(new Uint32Array(paper.getImageData(0, 0, 64, 48).data.buffer)).size;
}

/** A model with the state of the widget, whose bytes are a DataView as in anywidget. */
async function model() {
  const state = await (await fetch("state.json")).json();
  const bytes = async (name) => new DataView(await (await fetch(name)).arrayBuffer());
  state.content = await bytes("frames");
  const listeners = {}, saved = {};
  return {
    saved, bytes,
    get: (name) => state[name],
    set: (name, value) => (state[name] = saved[name] = value),
    save_changes: () => {},
    on: (event, done) => (listeners[event] = done),
    off: (event) => delete listeners[event],
    change: (name, value) => ((state[name] = value), listeners[`change:${name}`]()),
    listening: () => Object.keys(listeners).length,
  };
}

export default async function () {
  const address = location.href;
  const widget = (await import("./esm.js")).default;
  const shown = await model();
  const el = document.body.appendChild(document.createElement("div"));
  const end = await widget.render({ model: shown, el });
  const root = el.firstElementChild.shadowRoot;
  const canvas = await until("a canvas", () => root.querySelector("canvas"));
  await until("the first frame", () => canvas.dataset.frame === shown.get("frame").toString());
  const first = Number(canvas.dataset.simulated_s);
  const button = root.querySelector("button.main");
  button.click();
  await until("it plays", () => Number(canvas.dataset.frame) > shown.get("frame") + 2);
  button.click();
  const second = Number(canvas.dataset.simulated_s);
  await until("the choices", () => shown.saved.frame);
  const seen = {
    first, second, saved: shown.saved, subparticles: Number(canvas.dataset.subparticles), colours: await colours(canvas),
    height: canvas.clientHeight, button: getComputedStyle(button).backgroundColor, is_same_page: location.href === address,
    image: canvas.toDataURL(),
  };
  shown.change("content", new DataView(new TextEncoder().encode("no stream of frames at all").buffer));
  seen.fault = await until("a fault", () => !root.querySelector(".fault").hidden && root.querySelector(".fault").textContent);
  seen.canvases = root.querySelectorAll("canvas").length;
  shown.change("content", await shown.bytes("frames"));
  await until("another canvas", () => root.querySelector("canvas")?.dataset.frame);
  end();
  return { ...seen, listening: shown.listening() };
}
