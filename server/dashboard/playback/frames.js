// @ts-check
// Reader of a stream of frames (docs/frames.md): byte ranges from the server, unpacked in another thread, in a cache of limited size.

const MAGIC = "ROOSTF\r\n";
/** Size of the cache of unpacked frames: 130 frames of 80,000 sub-particles. */
const MAX_BYTES = 256e6;
const BYTES_PER_SUBPARTICLE = 24;

/**
 * Reads byte ranges, or the whole file once where the server does not support ranges.
 * @param {string} url
 */
function source(url) {
  /** @type {ArrayBuffer | undefined} */
  let whole;
  let length = 0;
  const slice = async (/** @type {number} */ from, /** @type {number} */ to) => {
    if (whole) return whole.slice(from, to);
    const response = await fetch(url, { headers: { range: `bytes=${from}-${to - 1}` } });
    if (response.status === 404) return null;
    if (!response.ok) throw new Error(`The frames cannot be read: the server answers ${response.status}.`);
    const bytes = await response.arrayBuffer();
    if (response.status === 206) {
      length = Number(response.headers.get("content-range")?.split("/")[1]);
      return bytes;
    }
    whole = bytes;
    length = bytes.byteLength;
    return whole.slice(from, to);
  };
  /** The same where the file is known to exist. */
  const part = async (/** @type {number} */ from, /** @type {number} */ to) => {
    const bytes = await slice(from, to);
    if (!bytes) throw new Error("The frames have been deleted.");
    return bytes;
  };
  return { slice, part, length: () => length };
}

/** @param {ArrayBuffer} buffer @param {number} from @param {number} to */
const text = (buffer, from, to) => new TextDecoder().decode(new Uint8Array(buffer, from, to - from));

/**
 * Opens the stream at a path; null when there is none.
 * @param {string} url
 */
export async function frames(url) {
  const file = source(url);
  const first = await file.slice(0, 1 << 16);
  if (!first || file.length() < 16) return null;
  if (text(first, 0, 8) !== MAGIC || text(first, 8, 12) !== "HEAD") throw new Error("This is not a stream of frames.");
  const size = new DataView(first).getUint32(12, true);
  const rest = 16 + size <= first.byteLength ? first : await file.part(0, 16 + size);
  const head = JSON.parse(text(rest, 16, 16 + size));
  const index = (await storedIndex(file)) ?? (await scan(file, 16 + size));
  return reader(file, head, index);
}

/**
 * The index at the end of a complete file; null where it has none.
 * @param {ReturnType<typeof source>} file
 */
async function storedIndex(file) {
  const end = file.length();
  const last = await file.part(end - 16, end);
  if (text(last, 0, 4) !== "LAST") return null;
  const at = Number(new DataView(last).getBigUint64(8, true));
  const chunk = await file.part(at, end - 16);
  const view = new DataView(chunk), count = view.getUint32(4, true) / 24;
  /** @type {FrameIndexEntry[]} */
  const index = Array.from({ length: count }, (_, k) => ({ end: at, at: Number(view.getBigUint64(8 + 24 * k, true)), simulated_s: view.getFloat64(16 + 24 * k, true), t_s: view.getFloat64(24 + 24 * k, true) }));
  index.slice(1).forEach((next, k) => (index[k].end = next.at));
  return index;
}

/**
 * The index of an incomplete file, by a walk over its complete chunks.
 * @param {ReturnType<typeof source>} file @param {number} from
 */
async function scan(file, from) {
  /** @type {FrameIndexEntry[]} */
  const index = [];
  for (let at = from; at + 24 <= file.length(); ) {
    const view = new DataView(await file.part(at, at + 24));
    const end = at + 8 + view.getUint32(4, true);
    if (end > file.length()) break;
    if (view.getUint32(0, false) === 0x4652414d) index.push({ at, end, simulated_s: view.getFloat64(8, true), t_s: view.getFloat64(16, true) });
    at = end;
  }
  return index;
}

/** @param {ReturnType<typeof source>} file @param {FrameHeader} head @param {FrameIndexEntry[]} index */
function reader(file, head, index) {
  const thread = new Worker(new URL("./unpack.js", import.meta.url));
  thread.postMessage({ counts: head.bodies.map((kind) => head.kinds[kind].subparticles) });
  /** @type {Map<number, { done: (frame: Frame) => void, failed: (error: Error) => void }>} */
  const pending = new Map();
  /**
   * Frames by index, the least recently used first.
   * @type {Map<number, Promise<Frame>>}
   */
  const cache = new Map();
  thread.onmessage = ({ data: { id, frame, error } }) => {
    const request = pending.get(id);
    pending.delete(id);
    if (error) request?.failed(new Error(`Frame ${id} cannot be unpacked: ${error}`));
    else request?.done(frame);
  };
  const total = head.bodies.reduce((sum, kind) => sum + head.kinds[kind].subparticles, 0);
  const capacity = Math.max(12, Math.floor(MAX_BYTES / (BYTES_PER_SUBPARTICLE * Math.max(1, total))));

  /** @param {number} k */
  function frame(k) {
    const found = cache.get(k) ?? load(k);
    cache.delete(k);
    cache.set(k, found);
    for (const oldest of cache.keys()) {
      if (cache.size <= capacity) break;
      cache.delete(oldest);
    }
    // A failed read is not cached.
    found.catch(() => cache.get(k) === found && cache.delete(k));
    return found;
  }
  /** @param {number} k @returns {Promise<Frame>} */
  async function load(k) {
    const chunk = await file.part(index[k].at, index[k].end);
    return new Promise((done, failed) => {
      pending.set(k, { done, failed });
      thread.postMessage({ id: k, chunk }, [chunk]);
    });
  }
  /** Loads the frames after k into the cache. */
  const prefetch = (/** @type {number} */ k, count = 6) => {
    for (let next = k + 1; next <= Math.min(k + count, index.length - 1); next++) if (!cache.has(next)) frame(next).catch(() => {});
  };
  return { head, index, total, frame, prefetch, end: () => thread.terminate() };
}
