// Workers and their devices: what each does, how fast, and when it was last heard of.

import { now, poll, post } from "../api.js";
import { fill, h } from "../dom.js";
import { ago, many, number, short } from "../format.js";
import { action, fault, table } from "../parts.js";

/** Beats come every two seconds, and leases end this long after one: who is silent that long holds nothing any more. */
const SILENT_S = 15;
/** Workers that are gone add up for ever: so many are drawn. */
const MOST_GONE = 200;

const isHere = (worker) => (now() - Date.parse(worker.last_seen_at)) / 1000 < SILENT_S;

function status(worker) {
  if (!isHere(worker)) return h("span", { class: "state cancelled" }, "gone");
  if (worker.draining) return h("span", { class: "state cancelled" }, "draining");
  return worker.running.length > 0 ? h("span", { class: "state running" }, "running") : h("span", { class: "state queued" }, "idle");
}

const jobs = (worker) => {
  const done = (i) => (worker.progress?.[i] ? ` ${Math.floor(100 * worker.progress[i].fraction)} % ` : " ");
  const links = worker.running.slice(0, 4).map((id, i) => [h("a", { href: `/jobs/${id}`, class: "mono" }, short(id)), done(i)]);
  return [links, worker.running.length > 4 && `and ${worker.running.length - 4} more`];
};

const COLUMNS = [
  { title: "Worker", cell: (worker) => h("strong", {}, worker.name) },
  { title: "State", cell: status },
  { title: "Device", is_text: true, cell: (worker) => `${worker.backend}: ${worker.device}` },
  { title: "Threads", is_number: true, cell: (worker) => worker.threads },
  { title: "Memory", is_number: true, cell: (worker) => (worker.memory_mib ? `${(worker.memory_mib / 1024).toFixed(1)} GiB` : "–") },
  { title: "Runs", is_text: true, cell: jobs },
  { title: "Speed", is_number: true, cell: (worker) => (worker.particle_steps_per_s ? `${number(worker.particle_steps_per_s / 1e6, 3)} M/s` : "–") },
  { title: "Results", is_number: true, cell: (worker) => worker.succeeded.toLocaleString("en") },
  { title: "Failures", is_number: true, cell: (worker) => worker.failed.toLocaleString("en") },
  { title: "Revision", is_number: true, cell: (worker) => worker.solver_revision },
  { title: "Registered", cell: (worker) => ago(worker.registered_at) },
  { title: "Last heard", cell: (worker) => ago(worker.last_seen_at) },
  { title: "", cell: (worker) => isHere(worker) && !worker.draining
      ? action("Drain", () => post(`/v1/workers/${worker.id}/drain`).then(() => `${worker.name} claims nothing more`), { ask: () => `${worker.name} is to finish what it runs and end?` })
      : "" },
];

export function show(main) {
  document.title = "Workers · Roost";
  const [here, gone, trouble] = [h("section", { class: "card wide" }), h("section"), h("div")];
  main.append(h("h1", {}, "Workers"), trouble, here, gone);
  let page = { items: [] };
  const draw = () => {
    const there = page.items.filter(isHere);
    const rest = page.items.filter((worker) => !isHere(worker));
    const running = there.reduce((sum, worker) => sum + worker.running.length, 0);
    fill(here, there.length === 0
      ? h("p", {}, "No worker is there. ", h("code", {}, `roost work --server ${location.origin}`), " starts one.")
      : table(`${there.length} there, ${many(running, "job")} running; speed in million particle-steps a second`, COLUMNS, there));
    if (rest.length > 0 && !gone.querySelector("details[open]")) {
      fill(gone, h("details", { class: "card wide" }, h("summary", {}, `${rest.length.toLocaleString("en")} gone`),
        table(rest.length > MOST_GONE ? `Not heard of lately: the newest ${MOST_GONE}` : "Not heard of lately", COLUMNS, rest.slice(0, MOST_GONE))));
    }
  };
  poll("/v1/workers?limit=500", 5, (value) => ((page = value), draw()), (error) => fill(trouble, error ? fault(error) : []), { is_whole: true });
  // Times pass also while nothing changes.
  setInterval(() => document.hidden || draw(), 5000);
}
