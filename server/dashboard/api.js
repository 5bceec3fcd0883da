// The API as pages use it: reads with tags, writes that are made once, and what is followed as it happens.

import { signIn } from "./session.js";

/** What changes something counts, with a session, only beside this header: pages of others cannot send it. */
const OURS = { "x-roost-page": "dashboard" };

/** A problem document (RFC 9457) that the server answered. */
export class Problem extends Error {
  constructor(problem) {
    super(problem.detail ?? problem.title);
    Object.assign(this, { type: problem.type, status: problem.status, errors: problem.errors ?? [] });
  }
}

async function answered(response) {
  if (response.ok) return response;
  if (response.status === 401) signIn();
  const problem = await response.json().catch(() => ({ title: `The server answers ${response.status}`, status: response.status }));
  throw new Problem(problem);
}

/** Whether what failed may go well later: the server was not there, or had too much to do. */
export const passes = ({ status }) => !(status >= 400 && status < 500) || status === 429;

let ahead_ms = 0;

/** Now by the server's clock, in ms. */
export const now = () => Date.now() - ahead_ms;

/** Answers are dated to the second; what lies within that and the way here is no difference between two clocks. */
function dated(response) {
  const ahead = Date.now() - Date.parse(response.headers.get("date"));
  if (!Number.isNaN(ahead)) ahead_ms = Math.abs(ahead) < 3000 ? 0 : ahead;
  return response;
}

/** Reads JSON. */
export async function read(path, options) {
  return (await answered(dated(await fetch(path, options)))).json();
}

/** Posts JSON, or nothing; with a key, a repeat makes nothing again. */
export async function post(path, body, key) {
  const headers = body === undefined ? { ...OURS } : { ...OURS, "content-type": "application/json" };
  if (key) headers["idempotency-key"] = key;
  const response = await fetch(path, { method: "POST", headers, body: body === undefined ? undefined : JSON.stringify(body) });
  return (await answered(response)).json();
}

/** A UUID; `crypto.randomUUID` is there with https and on the server's own machine alone. */
function uuid() {
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  [bytes[6], bytes[8]] = [(bytes[6] & 15) | 64, (bytes[8] & 63) | 128];
  return Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("").replace(/^(.{8})(.{4})(.{4})(.{4})/, "$1-$2-$3-$4-");
}

/** Posts what makes something. The same body has the same key until it has been made: sent again because an answer was lost, it makes nothing twice. */
export function maker(path) {
  let key = null, last = null;
  return async (body) => {
    const text = JSON.stringify(body);
    if (text !== last) [key, last] = [uuid(), text];
    const made = await post(path, body, key);
    last = null;
    return made;
  };
}

/** Does `work` for each new key. What fails is told, and tried again until it passes or another key comes. */
export function once(work, failed, rest_s = 5) {
  let last = null, timer = null;
  const attempt = async (key) => {
    try {
      await work(key);
      if (key === last) failed(null);
    } catch (error) {
      if (key !== last) return;
      failed(error);
      if (passes(error)) timer = setTimeout(attempt, 1000 * rest_s, key);
    }
  };
  return (key) => {
    if (key === last) return;
    clearTimeout(timer);
    attempt((last = key));
  };
}

/** Reads JSON unless it is what `seen`, by path, has of it; says whether it is new. */
async function reread(path, seen) {
  const before = seen.get(path);
  // The browser's own cache would hide the 304.
  const response = dated(await fetch(path, { headers: before ? { "if-none-match": before.tag } : {}, cache: "no-store" }));
  if (response.status === 304) return { value: before.value, is_new: false };
  const value = await (await answered(response)).json(), tag = response.headers.get("etag");
  if (tag) seen.set(path, { tag, value });
  return { value, is_new: true };
}

/**
 * Looks every `interval_s` whether a path has changed, and says so; of a listing with `is_whole`, all its pages as one. What has not changed is
 * answered 304. Nobody looks while nobody sees the page. Returns what ends it.
 */
export function poll(path, interval_s, changed, failed, { is_whole = false } = {}) {
  const seen = new Map();
  let timer = null, ended = false;
  const look = async () => {
    if (!document.hidden) {
      try {
        let { value, is_new } = await reread(path, seen);
        for (let cursor = is_whole && value.next_cursor; cursor; cursor = value.next_cursor) {
          const next = await reread(`${path}&cursor=${cursor}`, seen);
          value = { items: [...value.items, ...next.value.items], next_cursor: next.value.next_cursor };
          is_new ||= next.is_new;
        }
        if (ended) return;
        if (is_new) changed(value);
        failed(null);
      } catch (error) {
        if (ended) return;
        failed(error);
      }
    }
    if (!ended) timer = setTimeout(look, 1000 * interval_s);
  };
  look();
  return () => ((ended = true), clearTimeout(timer));
}

/**
 * Follows `path`/events: `show` gets the subject whenever it is another, `on` may have listeners of other events by their name: `change` of a job's
 * state, `samples` of a running job. Nothing is followed while nobody sees the page: browsers keep few connections to a server. Where a
 * stream breaks off for good, the subject is polled instead.
 */
export function follow(path, show, on, failed) {
  let events = null, heard = false, is_over = false;
  const shown = (event) => ((heard = true), failed(null), show(JSON.parse(event.data)));
  const close = () => (events?.close(), (events = null));
  const end = () => ((is_over = true), close());
  function open() {
    events = new EventSource(`${path}/events`);
    for (const name of ["sweep", "job", "progress", "extended"]) events.addEventListener(name, shown);
    for (const [name, listener] of Object.entries(on)) events.addEventListener(name, (event) => listener(JSON.parse(event.data)));
    events.addEventListener("deleted", () => (end(), failed(new Error("this sweep has been deleted"))));
    events.addEventListener("error", () => {
      if (events.readyState === EventSource.CLOSED || !heard) {
        end();
        poll(path, 3, show, failed);
      } else failed(new Error("the server does not answer; trying again"));
    });
  }
  const look = () => {
    if (document.hidden) close();
    else if (!events && !is_over) open();
  };
  document.addEventListener("visibilitychange", look);
  // A page that is left may be kept whole, and shown again on the way back.
  addEventListener("pagehide", close);
  addEventListener("pageshow", look);
  look();
}

/** Does `work` on every item, a few at a time, in their order. */
export async function each(items, work, at_once = 6) {
  const results = new Array(items.length);
  let next = 0;
  const lane = async () => {
    while (next < items.length) {
      const i = next++;
      results[i] = await work(items[i], i);
    }
  };
  await Promise.all(Array.from({ length: Math.min(at_once, items.length) }, lane));
  return results;
}
