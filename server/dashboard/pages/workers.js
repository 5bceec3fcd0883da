// @ts-check
// Workers: their devices, running jobs, speed, and last heartbeat.

import { now, poll, post } from "../api.js";
import { fill, h } from "../dom.js";
import { plural, number, shortId } from "../format.js";
import { action, errorBox, since, table } from "../parts.js";

/** A worker without a heartbeat for this long is lost. Heartbeats come every two seconds, and leases end this long after one. */
const LEASE_S = 15;
/** Lost workers that are drawn, the newest first. */
const MAX_LOST = 200;

/** @param {WorkerView} worker */
const isAlive = (worker) => (now() - Date.parse(worker.last_seen_at)) / 1000 < LEASE_S;

/** @param {WorkerView} worker */
function status(worker) {
  if (!isAlive(worker)) return h("span", { class: "state cancelled" }, "lost");
  if (worker.draining) return h("span", { class: "state cancelled" }, "draining");
  return worker.running.length > 0 ? h("span", { class: "state running" }, "running") : h("span", { class: "state queued" }, "idle");
}

/** @param {WorkerView} worker @returns {Child[]} */
const jobs = (worker) => {
  const done = (/** @type {number} */ i) => {
    const progress = worker.progress?.[i];
    return progress ? ` ${Math.floor(100 * progress.fraction)} % ` : " ";
  };
  const links = worker.running.slice(0, 4).map((id, i) => [h("a", { href: `/jobs/${id}`, class: "mono" }, shortId(id)), done(i)]);
  return [links, worker.running.length > 4 && `and ${worker.running.length - 4} more`];
};

/** @type {Column<WorkerView>[]} */
const COLUMNS = [
  { title: "Worker", cell: (worker) => h("strong", {}, worker.name) },
  { title: "State", cell: status },
  { title: "Device", is_text: true, cell: (worker) => `${worker.backend}: ${worker.device}` },
  { title: "Threads", is_number: true, cell: (worker) => worker.threads },
  { title: "Memory", is_number: true, cell: (worker) => (worker.memory_mib ? `${(worker.memory_mib / 1024).toFixed(1)} GiB` : "–") },
  { title: "Jobs", is_text: true, cell: jobs },
  { title: "Speed", is_number: true, cell: (worker) => (worker.particle_steps_per_s ? `${number(worker.particle_steps_per_s / 1e6, 3)} M/s` : "–") },
  { title: "Results", is_number: true, cell: (worker) => worker.succeeded.toLocaleString("en") },
  { title: "Failures", is_number: true, cell: (worker) => worker.failed.toLocaleString("en") },
  { title: "Revision", is_number: true, cell: (worker) => worker.solver_revision },
  { title: "Registered", cell: (worker) => since(worker.registered_at) },
  { title: "Last heartbeat", cell: (worker) => since(worker.last_seen_at) },
  { title: "Action", cell: (worker) => isAlive(worker) && !worker.draining
      ? action("Drain", () => post(`/v1/workers/${worker.id}/drain`).then(() => `${worker.name} finishes its jobs and exits`), { ask: () => `Drain ${worker.name}? It will finish its jobs, claim no more, and exit.` })
      : "" },
];

/** @param {HTMLElement} main */
export function show(main) {
  document.title = "Workers · Roost";
  const [connected, lost, errors] = [h("section", { class: "card wide" }), h("section"), h("div")];
  main.append(h("h1", {}, "Workers"), errors, connected, lost);
  /** @type {Page<WorkerView>} */
  let page = { items: [] };
  const draw = () => {
    const alive = page.items.filter(isAlive);
    const rest = page.items.filter((worker) => !isAlive(worker));
    const running = alive.reduce((sum, worker) => sum + worker.running.length, 0);
    fill(connected, alive.length === 0
      ? h("p", {}, "No worker is connected. To start one, run ", h("code", {}, `roost work --server ${location.origin}`), ".")
      : table(`${alive.length} connected, ${plural(running, "job")} running; speed in million particle-steps per second`, COLUMNS, alive));
    if (rest.length > 0 && !lost.querySelector("details[open]")) {
      fill(lost, h("details", { class: "card wide" }, h("summary", {}, `${rest.length.toLocaleString("en")} lost`),
        table(rest.length > MAX_LOST ? `Workers without a recent heartbeat: the newest ${MAX_LOST}` : "Workers without a recent heartbeat", COLUMNS, rest.slice(0, MAX_LOST))));
    }
  };
  poll("/v1/workers?limit=500", 5, (value) => {
    page = value;
    draw();
  }, (error) => fill(errors, error ? errorBox(error) : []), { is_whole: true });
  // Workers become lost although the answer does not change.
  setInterval(() => document.hidden || draw(), 5000);
}
