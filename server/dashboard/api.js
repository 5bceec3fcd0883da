// The API as pages use it: reads with tags, writes, and what is followed as it happens.

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

/** Reads JSON. */
export async function read(path, options) {
  return (await answered(await fetch(path, options))).json();
}

/** Posts JSON, or nothing. What makes something carries a key, so that a repeat makes nothing again. */
export async function post(path, body, key) {
  const headers = body === undefined ? { ...OURS } : { ...OURS, "content-type": "application/json" };
  if (key) headers["idempotency-key"] = key;
  const response = await fetch(path, { method: "POST", headers, body: body === undefined ? undefined : JSON.stringify(body) });
  return (await answered(response)).json();
}

/** Every page of a listing up to `most` rows. */
export async function pages(path, most = 500) {
  const items = [];
  let cursor = null;
  do {
    const url = new URL(path, location.href);
    url.searchParams.set("limit", Math.min(500, most - items.length));
    if (cursor) url.searchParams.set("cursor", cursor);
    const page = await read(url);
    items.push(...page.items);
    cursor = page.next_cursor;
  } while (cursor && items.length < most);
  return { items, more: cursor !== null };
}

/**
 * Looks every `interval_s` whether a path has changed, and says so. What has not changed is answered 304. Nobody looks
 * while nobody sees the page. Returns what ends it.
 */
export function poll(path, interval_s, changed, failed) {
  let tag = null, timer = null, ended = false;
  const look = async () => {
    if (!document.hidden) {
      try {
        // The browser's own cache would hide the 304.
        const response = await fetch(path, { headers: tag ? { "if-none-match": tag } : {}, cache: "no-store" });
        if (response.status !== 304) {
          const value = await (await answered(response)).json();
          if (ended) return;
          tag = response.headers.get("etag");
          changed(value);
        }
        failed?.(null);
      } catch (error) {
        failed?.(error);
      }
    }
    if (!ended) timer = setTimeout(look, 1000 * interval_s);
  };
  look();
  return () => ((ended = true), clearTimeout(timer));
}

/**
 * Follows `path`/events: `show` gets the subject whenever it is another, `on` may have listeners of other events by their name: `change` of a job's
 * state, `samples` of a running job. Where a stream breaks off for good, the subject is polled instead. Returns what ends it.
 */
export function follow(path, show, on, failed) {
  const events = new EventSource(`${path}/events`);
  let polling = null, heard = false;
  const shown = (event) => ((heard = true), failed(null), show(JSON.parse(event.data)));
  for (const name of ["sweep", "job", "progress", "extended"]) events.addEventListener(name, shown);
  for (const [name, listener] of Object.entries(on)) events.addEventListener(name, (event) => listener(JSON.parse(event.data)));
  const end = () => (events.close(), polling?.());
  events.addEventListener("deleted", () => (end(), failed(new Error("this sweep has been deleted"))));
  events.addEventListener("error", () => {
    if (events.readyState === EventSource.CLOSED || !heard) {
      events.close();
      polling ??= poll(path, 3, show, failed);
    } else failed(new Error("the server does not answer; trying again"));
  });
  addEventListener("pagehide", end);
  return end;
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
