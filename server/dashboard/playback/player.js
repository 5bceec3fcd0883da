// @ts-check
// The player of frames: a canvas, a time line, and controls of speed, colour and view.

import { h, announce } from "../dom.js";
import { number } from "../format.js";
import { choice, parameter, setParameters } from "../parts.js";
import { camera } from "./camera.js";
import { frames } from "./frames.js";
import { scene } from "./scene.js";

/** Values that colour sub-particles. @type {Option[]} */
const COLOURS = [["body", "body"], ["speed", "speed"], ["damage", "broken bonds"]];

/**
 * The surroundings of a player: choices that outlive it, by name, and messages to the reader. By default the choices are in the page's address.
 * @typedef {{ kept: (name: string) => string | null, keep: (choices: Record<string, string | number>) => void, announce: (text: string) => void }} Surroundings
 */

/** @type {Surroundings} */
const PAGE = { kept: parameter, keep: setParameters, announce };

/** A longer time between two images is a pause, which the mean leaves out. */
const PAUSE_MS = 500;

/**
 * The player of the frames at a path, with a function that ends it; null when there are no frames.
 * @param {string} url @param {Surroundings} [surroundings]
 */
export async function player(url, { kept, keep, announce } = PAGE) {
  const opened = await frames(url);
  if (!opened || opened.index.length === 0) return null;
  const stream = opened;
  const { head, index } = stream;
  const canvas = h("canvas", { tabindex: 0, role: "img", "aria-label": "Playback of the job. Arrow keys turn the view, plus and minus zoom, space plays." });
  const drawing = scene(canvas, head);
  /** @type {{ k: number, colour: string, speed: number, is_playing: boolean, frame: Frame | null }} */
  const state = { k: 0, colour: kept("colour") ?? "body", speed: 1, is_playing: false, frame: null };
  const top = h("output"), time = h("output", { class: "mono" }), rate = h("output", { class: "dim" });
  const line = h("input", { type: "range", min: 0, max: index.length - 1, step: 1, value: 0, "aria-label": "Frame", oninput: () => void go(Number(line.value)) });
  const button = h("button", { type: "button", class: "main", onclick: () => (state.is_playing ? pause() : play()) }, "Play");
  const equipment = h("input", { type: "checkbox", checked: true, onchange: () => load() });
  const scale = h("span", { class: "row", hidden: true }, "0", h("span", { class: "legend" }), top);

  const { low, high } = bounds(head);
  const view = camera(canvas, low, high, () => redraw());
  /** @type {number | null} */
  let frame_ms = null;
  let is_due = false, drawn_at = 0;
  function redraw() {
    if (is_due) return;
    is_due = true;
    requestAnimationFrame((now) => {
      is_due = false;
      drawNow();
      measure(now - drawn_at);
      drawn_at = now;
    });
  }
  /**
   * Shows the running mean of the time between two images.
   * @param {number} ms
   */
  function measure(ms) {
    if (ms > PAUSE_MS) return;
    frame_ms = frame_ms === null ? ms : 0.9 * frame_ms + 0.1 * ms;
    rate.textContent = `${frame_ms.toFixed(0)} ms per image`;
    canvas.dataset.frame_ms = frame_ms.toFixed(1);
  }
  function drawNow() {
    const ratio = Math.min(2, devicePixelRatio);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((pixels) => Math.max(1, Math.round(ratio * pixels)));
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    drawing.draw(view.matrices(width / height), state.colour === "body" ? 0 : 1);
  }

  let max_m_s = 0.5, max_broken = 1;
  /**
   * The value of each sub-particle. Scales reach the maximum of all frames so far, so that colours change little.
   * @param {Frame} frame
   */
  function values(frame) {
    max_m_s = Math.max(max_m_s, frame.top_m_s);
    for (const broken of frame.broken) max_broken = Math.max(max_broken, broken);
    if (state.colour === "speed") return frame.speeds.map((speed) => Math.sqrt(speed / max_m_s));
    if (state.colour === "damage") return frame.broken.map((broken) => broken / max_broken);
    return Float32Array.from(frame.bodies);
  }

  function load() {
    const { frame } = state;
    if (!frame) return;
    drawing.load(frame, values(frame), equipment.checked ? head.surfaces : []);
    scale.hidden = state.colour === "body";
    top.textContent = state.colour === "speed" ? `${number(max_m_s, 3)} m/s (square-root scale)` : `${max_broken} bonds`;
    redraw();
  }

  /** @param {number} k */
  async function show(k) {
    state.k = k;
    line.value = String(k);
    const frame = await stream.frame(k);
    stream.prefetch(k);
    // Another frame was chosen meanwhile.
    if (state.k !== k) return;
    state.frame = frame;
    const t = Number.isNaN(frame.t_s) ? `filling, ${frame.simulated_s.toFixed(2)} s` : `t = ${frame.t_s.toFixed(2)} s`;
    time.textContent = `${t} · ${frame.count.toLocaleString("en")} sub-particles · frame ${k + 1} of ${index.length}`;
    line.setAttribute("aria-valuetext", t);
    Object.assign(canvas.dataset, { frame: k, subparticles: frame.count, simulated_s: frame.simulated_s });
    load();
  }

  /** Number of the newest call of `play`: earlier ones stop. */
  let plays = 0;
  async function play() {
    const mine = ++plays;
    state.is_playing = true;
    button.textContent = "Pause";
    if (state.k === index.length - 1) await show(0).catch(failed);
    let from = performance.now(), start = index[state.k].simulated_s;
    const step = async (/** @type {number} */ now) => {
      if (!state.is_playing || mine !== plays) return;
      const due = start + (state.speed * (now - from)) / 1000;
      let k = state.k;
      while (k + 1 < index.length && index[k + 1].simulated_s <= due) k++;
      if (k !== state.k) {
        await show(k).catch(failed);
        if (mine !== plays) return;
        // A late frame delays the clock; no frame is skipped for it.
        const is_late = index[k].simulated_s + 0.25 < start + (state.speed * (performance.now() - from)) / 1000;
        if (is_late) [from, start] = [performance.now(), index[k].simulated_s];
      }
      if (k === index.length - 1) pause();
      else requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }
  const failed = (/** @type {Error} */ error) => {
    pause();
    announce(error.message);
  };
  function pause() {
    state.is_playing = false;
    button.textContent = "Play";
    keep({ frame: state.k, view: view.asText() });
  }
  const go = (/** @type {number} */ k) => {
    pause();
    show(k).catch(failed);
  };
  function save() {
    // The browser clears the canvas after showing it.
    drawNow();
    canvas.toBlob((blob) => {
      if (!blob) return;
      const link = h("a", { href: URL.createObjectURL(blob), download: `frame-${state.k}.png` });
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    });
  }
  canvas.addEventListener("keydown", (event) => {
    if (event.key === " ") {
      event.preventDefault();
      button.click();
    }
    if (event.key === "," && state.k > 0) go(state.k - 1);
    if (event.key === "." && state.k + 1 < index.length) go(state.k + 1);
  });
  new ResizeObserver(redraw).observe(canvas);

  const element = h("section", { class: "card player" }, h("h2", {}, "Playback"), canvas,
    h("div", { class: "row" }, button, line, time),
    h("div", { class: "row" },
      choice("Colour by", COLOURS, state.colour, (value) => {
        state.colour = value;
        keep({ colour: value });
        load();
      }), scale,
      choice("Speed", [["0.1", "1/10"], ["0.25", "1/4"], ["1", "real time"], ["2", "double"]], "1", (value) => {
        const was_playing = state.is_playing;
        pause();
        state.speed = Number(value);
        if (was_playing) play();
      }),
      h("label", { class: "field" }, equipment, "equipment"),
      h("button", { type: "button", onclick: save }, "Save image"),
      h("span", { class: "dim" }, "drag: turn; Shift and drag: move; wheel: zoom; keys , and . : previous and next frame"), rate));
  const saved_view = kept("view");
  if (saved_view) view.set(saved_view);
  const first = Math.min(index.length - 1, Number(kept("frame") ?? 0) || 0);
  queueMicrotask(() => show(first).catch(failed));
  return { element, end: () => {
    plays++;
    stream.end();
  } };
}

/**
 * The bounding box of the surfaces, where there are any: the domain is often much larger.
 * @param {FrameHeader} head
 */
function bounds(head) {
  const points = head.surfaces.filter((one) => one.presence === "always").flatMap((one) => one.triangles_m.flat());
  const inside = points.filter((point) => point.every((x, i) => x >= head.low_m[i] - 1e-6 && x <= head.high_m[i] + 1e-6));
  if (inside.length < 3) return { low: head.low_m, high: head.high_m };
  const side = (/** @type {(a: number, b: number) => number} */ pick) => [0, 1, 2].map((i) => inside.reduce((best, point) => pick(best, point[i]), inside[0][i]));
  const [low, high] = [side(Math.min), side(Math.max)];
  // A belt alone has no height: the domain's takes its place.
  const is_flat = low.map((x, i) => high[i] - x < 0.05 * (head.high_m[i] - head.low_m[i]));
  return { low: low.map((x, i) => (is_flat[i] ? head.low_m[i] : x)), high: high.map((x, i) => (is_flat[i] ? head.high_m[i] : x)) };
}
