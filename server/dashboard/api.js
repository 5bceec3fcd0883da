// @ts-check
// Requests to the API: polling with entity tags, writes that are safe to repeat, and event streams.

import { signIn } from "./session.js";

/** The server accepts writes of a session only with this header, which pages of other sites cannot send. */
const DASHBOARD_HEADER = { "x-roost-page": "dashboard" };

/** A problem document (RFC 9457) that the server answered. */
export class Problem extends Error {
  /** @param {Partial<ProblemDocument>} problem */
  constructor(problem) {
    super(problem.detail ?? problem.title);
    this.type = problem.type;
    this.status = problem.status;
    this.errors = problem.errors ?? [];
  }
}

/**
 * Throws the problem of an error response; opens the sign-in dialog for 401.
 * @param {Response} response
 */
async function checkStatus(response) {
  if (response.ok) return response;
  if (response.status === 401) signIn();
  const problem = await response.json().catch(() => ({ title: `The server answers ${response.status}`, status: response.status }));
  throw new Problem(problem);
}

/**
 * Whether a request may succeed later: the server did not answer, or it is overloaded.
 * @param {unknown} error
 */
export function isTemporary(error) {
  const status = statusOf(error);
  return !(status !== undefined && status >= 400 && status < 500) || status === 429;
}

/**
 * The HTTP status of an error; undefined where no answer came.
 * @param {unknown} error @returns {number | undefined}
 */
const statusOf = (error) => /** @type {{ status?: number }} */ (error).status;

/** Clock of this browser minus clock of the server, in ms. */
let clock_offset_ms = 0;

/** The server's time now, in ms. */
export const now = () => Date.now() - clock_offset_ms;

/**
 * Notes the server's clock. Response dates are whole seconds, so differences below 3 s count as none.
 * @param {Response} response
 */
function readClock(response) {
  const offset = Date.now() - Date.parse(response.headers.get("date") ?? "");
  if (!Number.isNaN(offset)) clock_offset_ms = Math.abs(offset) < 3000 ? 0 : offset;
  return response;
}

/**
 * Reads JSON. The caller states the type of the answer.
 * @param {string} path @param {RequestInit} [options] @returns {Promise<any>}
 */
export async function read(path, options) {
  return (await checkStatus(readClock(await fetch(path, options)))).json();
}

/**
 * Reads JSON; null where the server answers 404.
 * @param {string} path @returns {Promise<any>}
 */
export const readIfThere = (path) => read(path).catch((error) => (statusOf(error) === 404 ? null : Promise.reject(error)));

/**
 * Posts JSON, or an empty body. A repeat with the same idempotency key changes nothing.
 * @param {string} path @param {unknown} [body] @param {string} [key] @returns {Promise<any>}
 */
export async function post(path, body, key) {
  /** @type {Record<string, string>} */
  const headers = body === undefined ? { ...DASHBOARD_HEADER } : { ...DASHBOARD_HEADER, "content-type": "application/json" };
  if (key) headers["idempotency-key"] = key;
  const response = await fetch(path, { method: "POST", headers, body: body === undefined ? undefined : JSON.stringify(body) });
  return (await checkStatus(response)).json();
}

/** A random UUID. Browsers offer `crypto.randomUUID` only over https and on localhost. */
function uuid() {
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  [bytes[6], bytes[8]] = [(bytes[6] & 15) | 64, (bytes[8] & 63) | 128];
  return Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("").replace(/^(.{8})(.{4})(.{4})(.{4})/, "$1-$2-$3-$4-");
}

/**
 * A function that posts to `path`. It keeps the idempotency key of a body until a post of it succeeds, so a retry after a lost answer creates
 * nothing twice.
 * @param {string} path
 */
export function idempotentPost(path) {
  /** @type {string | undefined} */
  let key;
  /** @type {string | null} */
  let last = null;
  return async (/** @type {unknown} */ body) => {
    const text = JSON.stringify(body);
    if (text !== last) [key, last] = [uuid(), text];
    const created = await post(path, body, key);
    last = null;
    return created;
  };
}

/**
 * A function that runs `work` for each new key. `failed` gets the error, or null after success. A temporary failure is retried every `retry_s`
 * until it succeeds or another key arrives.
 * @param {(key: string) => Promise<unknown>} work @param {(error: any) => unknown} failed @param {number} [retry_s]
 */
export function runLatest(work, failed, retry_s = 5) {
  /** @type {string | null} */
  let last = null;
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  let timer;
  const attempt = async (/** @type {string} */ key) => {
    try {
      await work(key);
      if (key === last) failed(null);
    } catch (error) {
      if (key !== last) return;
      failed(error);
      if (isTemporary(error)) timer = setTimeout(attempt, 1000 * retry_s, key);
    }
  };
  return (/** @type {string} */ key) => {
    if (key === last) return;
    clearTimeout(timer);
    attempt((last = key));
  };
}

/** @typedef {Map<string, { tag: string, value: any }>} Cache Answers by path, with their entity tags. */

/**
 * Reads JSON unless the cached answer is current.
 * @param {string} path @param {Cache} cache
 */
async function readIfChanged(path, cache) {
  const before = cache.get(path);
  // The browser's own cache would hide the 304.
  const response = readClock(await fetch(path, { headers: before ? { "if-none-match": before.tag } : {}, cache: "no-store" }));
  if (response.status === 304 && before) return { value: before.value, is_new: false };
  const value = await (await checkStatus(response)).json(), tag = response.headers.get("etag");
  if (tag) cache.set(path, { tag, value });
  return { value, is_new: true };
}

/**
 * Reads a path every `interval_s` and calls `changed` when the answer is new. With `is_whole`, all pages of a listing count as one answer.
 * A hidden page reads nothing. Returns a function that stops the polling.
 * @param {string} path @param {number} interval_s @param {(value: any) => unknown} changed @param {(error: any) => unknown} failed
 * @param {{ is_whole?: boolean }} [options]
 */
export function poll(path, interval_s, changed, failed, { is_whole = false } = {}) {
  /** @type {Cache} */
  const cache = new Map();
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  let timer;
  let ended = false;
  const readOnce = async () => {
    if (!document.hidden) {
      try {
        let { value, is_new } = await readIfChanged(path, cache);
        for (let cursor = is_whole && value.next_cursor; cursor; cursor = value.next_cursor) {
          const next = await readIfChanged(`${path}&cursor=${cursor}`, cache);
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
    if (!ended) timer = setTimeout(readOnce, 1000 * interval_s);
  };
  readOnce();
  return () => {
    ended = true;
    clearTimeout(timer);
  };
}

/**
 * Follows the event stream of a job or sweep. `changed` gets its view whenever it differs; `listeners` get other events by name: `change` of
 * a job's state, `samples` of a running job, `extended`. A hidden page closes its stream, since browsers open few connections to one server.
 * Where a stream breaks for good, the path is polled instead.
 * @param {string} path @param {(view: any) => unknown} changed @param {Record<string, (data: any) => unknown>} listeners
 * @param {(error: any) => unknown} failed
 */
export function follow(path, changed, listeners, failed) {
  /** @type {EventSource | null} */
  let events = null;
  let has_data = false, is_over = false;
  const receive = (/** @type {MessageEvent} */ event) => {
    has_data = true;
    failed(null);
    changed(JSON.parse(event.data));
  };
  const close = () => {
    events?.close();
    events = null;
  };
  const end = () => {
    is_over = true;
    close();
  };
  function open() {
    const source = (events = new EventSource(`${path}/events`));
    for (const name of ["sweep", "job", "progress", "extended"]) source.addEventListener(name, receive);
    for (const [name, listener] of Object.entries(listeners)) source.addEventListener(name, (event) => listener(JSON.parse(event.data)));
    source.addEventListener("deleted", () => {
      end();
      failed(new Error("This sweep has been deleted."));
    });
    source.addEventListener("error", () => {
      if (source.readyState === EventSource.CLOSED || !has_data) {
        end();
        poll(path, 3, changed, failed);
      } else failed(new Error("The server does not answer; the page keeps trying."));
    });
  }
  const update = () => {
    if (document.hidden) close();
    else if (!events && !is_over) open();
  };
  document.addEventListener("visibilitychange", update);
  // Browsers keep a page that is left, and show it again on the way back.
  addEventListener("pagehide", close);
  addEventListener("pageshow", update);
  update();
}

/**
 * Joins the two sources of one view: a stream or poll, and the answers to actions. An answer is dropped when another view arrived since its
 * request: that view may be newer, and the source will deliver the state after the action too.
 * @template T @param {(view: T) => unknown} changed @param {(view: T) => unknown} [answered] called with an answer that counts
 */
export function joinViews(changed, answered = changed) {
  let arrived = 0;
  return {
    arrive: (/** @type {T} */ view) => {
      arrived += 1;
      changed(view);
    },
    answer: async (/** @type {Promise<T>} */ request) => {
      const before = arrived, view = await request;
      if (arrived === before) answered(view);
    },
  };
}

/**
 * Runs `work` on every item, at most `concurrency` at a time, and returns the results in order.
 * @template T, R
 * @param {T[]} items @param {(item: T, i: number) => Promise<R>} work @param {number} [concurrency] @returns {Promise<R[]>}
 */
export async function mapConcurrently(items, work, concurrency = 6) {
  const results = new Array(items.length);
  let next = 0;
  const lane = async () => {
    while (next < items.length) {
      const i = next++;
      results[i] = await work(items[i], i);
    }
  };
  await Promise.all(Array.from({ length: Math.min(concurrency, items.length) }, lane));
  return results;
}
