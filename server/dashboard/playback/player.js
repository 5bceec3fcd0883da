// The player: a canvas, a time line, and how fast, in what colours, from where.

import { h, say } from "../dom.js";
import { number } from "../format.js";
import { asked, choice, remember } from "../parts.js";
import { camera } from "./camera.js";
import { frames } from "./frames.js";
import { scene } from "./scene.js";

/** Colourings by the number that the shader knows them by: 0 by body, else by share of the scale. */
const COLOURS = [["body", "body"], ["speed", "speed"], ["damage", "broken bonds"]];

/** Nothing was to be drawn for longer than this: no time of a picture. */
const REST_MS = 500;

/** The player of the frames behind a path, its `element` and what `end`s it; null when there are none. */
export async function player(url) {
  const stream = await frames(url);
  if (!stream || stream.index.length === 0) return null;
  const { head, index } = stream;
  const canvas = h("canvas", { tabindex: 0, role: "img", "aria-label": "Playback of the run. Arrow keys turn the view, plus and minus zoom, space plays." });
  const drawing = scene(canvas, head);
  const state = { k: 0, colour: asked("colour") ?? "body", speed: 1, is_playing: false, has_equipment: true, frame: null };
  const top = h("output"), time = h("output", { class: "mono" }), rate = h("output", { class: "dim" });
  const line = h("input", { type: "range", min: 0, max: index.length - 1, step: 1, value: 0, "aria-label": "Frame", oninput: () => go(Number(line.value)) });
  const button = h("button", { type: "button", class: "main", onclick: () => (state.is_playing ? pause() : play()) }, "Play");
  const equipment = h("input", { type: "checkbox", checked: true, onchange: () => ((state.has_equipment = equipment.checked), load()) });
  const scale = h("span", { class: "row", hidden: true }, "0", h("span", { class: "legend" }), top);

  const { low, high } = bounds(head);
  const view = camera(canvas, low, high, () => redraw());
  let is_due = false, drawn_at = 0, frame_ms = null;
  function redraw() {
    if (is_due) return;
    is_due = true;
    requestAnimationFrame((now) => {
      is_due = false;
      drawNow();
      pace(now - drawn_at);
      drawn_at = now;
    });
  }
  /** Time from one picture to the next while there is something to draw, as a running mean: as short as screen and graphics allow while the view turns. */
  function pace(ms) {
    if (ms > REST_MS) return;
    frame_ms = frame_ms === null ? ms : 0.9 * frame_ms + 0.1 * ms;
    rate.textContent = `${frame_ms.toFixed(0)} ms a picture`;
    canvas.dataset.frame_ms = frame_ms.toFixed(1);
  }
  function drawNow() {
    const ratio = Math.min(2, devicePixelRatio);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((pixels) => Math.max(1, Math.round(ratio * pixels)));
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    drawing.draw(view.matrices(width / height), state.colour === "body" ? 0 : 1);
  }

  /** What each sub-particle is coloured by. The scale of speeds is the whole run's so far, so that colours do not jump. */
  let top_m_s = 0.5, top_broken = 1;
  function values(frame) {
    top_m_s = Math.max(top_m_s, frame.top_m_s);
    for (const broken of frame.broken) top_broken = Math.max(top_broken, broken);
    if (state.colour === "speed") return frame.speeds.map((speed) => Math.sqrt(speed / top_m_s));
    if (state.colour === "damage") return frame.broken.map((broken) => broken / top_broken);
    return Float32Array.from(frame.bodies);
  }

  function load() {
    const { frame } = state;
    if (!frame) return;
    drawing.load(frame, values(frame), state.has_equipment ? head.surfaces : []);
    scale.hidden = state.colour === "body";
    top.textContent = state.colour === "speed" ? `${number(top_m_s, 3)} m/s (root)` : `${top_broken} bonds`;
    redraw();
  }

  async function show(k) {
    state.k = k;
    line.value = k;
    const frame = await stream.frame(k);
    stream.ahead(k);
    // Another may have been asked for meanwhile.
    if (state.k !== k) return;
    state.frame = frame;
    const t = Number.isNaN(frame.t_s) ? `filling, ${frame.simulated_s.toFixed(2)} s` : `t = ${frame.t_s.toFixed(2)} s`;
    time.textContent = `${t} · ${frame.count.toLocaleString("en")} sub-particles · frame ${k + 1} of ${index.length}`;
    line.setAttribute("aria-valuetext", t);
    Object.assign(canvas.dataset, { frame: k, subparticles: frame.count, simulated_s: frame.simulated_s });
    load();
  }

  /** Counts how often playing began: what an earlier beginning still has to do, it does not. */
  let turn = 0;
  async function play() {
    const mine = ++turn;
    state.is_playing = true;
    button.textContent = "Pause";
    if (state.k === index.length - 1) await show(0).catch(failed);
    let from = performance.now(), start = index[state.k].simulated_s;
    const step = async (now) => {
      if (!state.is_playing || mine !== turn) return;
      const due = start + (state.speed * (now - from)) / 1000;
      let k = state.k;
      while (k + 1 < index.length && index[k + 1].simulated_s <= due) k++;
      if (k !== state.k) {
        await show(k).catch(failed);
        if (mine !== turn) return;
        // What came late holds time back, rather than being skipped.
        const late_s = index[k].simulated_s + 0.25 < start + (state.speed * (performance.now() - from)) / 1000;
        if (late_s) [from, start] = [performance.now(), index[k].simulated_s];
      }
      if (k === index.length - 1) pause();
      else requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }
  const failed = (error) => (pause(), say(error.message));
  function pause() {
    state.is_playing = false;
    button.textContent = "Play";
    remember({ frame: state.k, view: view.told() });
  }
  const go = (k) => (pause(), show(k).catch(failed));
  function save() {
    // A canvas keeps its picture only until the browser has shown it.
    drawNow();
    canvas.toBlob((blob) => {
      const link = h("a", { href: URL.createObjectURL(blob), download: `frame-${state.k}.png` });
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    });
  }
  canvas.addEventListener("keydown", (event) => {
    if (event.key === " ") (event.preventDefault(), button.click());
    if (event.key === "," && state.k > 0) go(state.k - 1);
    if (event.key === "." && state.k + 1 < index.length) go(state.k + 1);
  });
  new ResizeObserver(redraw).observe(canvas);

  const element = h("section", { class: "card player" }, h("h2", {}, "Playback"), canvas,
    h("div", { class: "row" }, button, line, time),
    h("div", { class: "row" },
      choice("Colour by", COLOURS, state.colour, (value) => ((state.colour = value), remember({ colour: value }), load())), scale,
      choice("Speed", [["0.1", "1/10"], ["0.25", "1/4"], ["1", "real"], ["2", "double"]], "1", (value) => {
        const was_playing = state.is_playing;
        pause();
        state.speed = Number(value);
        if (was_playing) play();
      }),
      h("label", { class: "field" }, equipment, "equipment"),
      h("button", { type: "button", onclick: save }, "Save picture"),
      h("span", { class: "dim" }, "drag turns, with Shift moves; wheel zooms; , and . step"), rate));
  if (asked("view")) view.set(asked("view"));
  const first = Math.min(index.length - 1, Number(asked("frame") ?? 0) || 0);
  queueMicrotask(() => show(first).catch(failed));
  return { element, end: () => (turn++, stream.end()) };
}

/** The box that surfaces fill, where there are any: domains are often much larger. */
function bounds(head) {
  const points = head.surfaces.filter((one) => one.presence === "always").flatMap((one) => one.triangles_m.flat());
  const inside = points.filter((point) => point.every((x, i) => x >= head.low_m[i] - 1e-6 && x <= head.high_m[i] + 1e-6));
  if (inside.length < 3) return { low: head.low_m, high: head.high_m };
  const side = (pick) => [0, 1, 2].map((i) => inside.reduce((best, point) => pick(best, point[i]), inside[0][i]));
  const [low, high] = [side(Math.min), side(Math.max)];
  // A belt alone has no height.
  const is_flat = low.map((x, i) => high[i] - x < 0.05 * (head.high_m[i] - head.low_m[i]));
  return { low: low.map((x, i) => (is_flat[i] ? head.low_m[i] : x)), high: high.map((x, i) => (is_flat[i] ? head.high_m[i] : x)) };
}
