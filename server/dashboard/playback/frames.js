// A stream of frames (docs/frames.md) on the server: read piece by piece, unpacked aside, kept as far as memory allows.

const MAGIC = "ROOSTF\r\n";
/** What unpacked frames may take; at 24 bytes a sub-particle, 80,000 of them in 130 frames. */
const MOST_BYTES = 256e6;
const BYTES_EACH = 24;

/** Reads byte ranges; of a server that does not know ranges, the whole file once. */
function source(url) {
  let whole = null;
  const slice = async (from, to) => {
    if (whole) return whole.slice(from, to);
    const response = await fetch(url, { headers: { range: `bytes=${from}-${to - 1}` } });
    if (response.status === 404) return null;
    if (!response.ok) throw new Error(`the frames cannot be read: the server answers ${response.status}`);
    const bytes = await response.arrayBuffer();
    if (response.status === 206) {
      length = Number(response.headers.get("content-range").split("/")[1]);
      return bytes;
    }
    whole = bytes;
    length = bytes.byteLength;
    return whole.slice(from, to);
  };
  let length = 0;
  return { slice, length: () => length };
}

const text = (buffer, from, to) => new TextDecoder().decode(new Uint8Array(buffer, from, to - from));

/** The frames behind a path; null when there are none. */
export async function frames(url) {
  const file = source(url);
  const first = await file.slice(0, 1 << 16);
  if (!first || file.length() < 16) return null;
  if (text(first, 0, 8) !== MAGIC || text(first, 8, 12) !== "HEAD") throw new Error("the frames are not a stream of this kind");
  const size = new DataView(first).getUint32(12, true);
  const rest = 16 + size <= first.byteLength ? first : await file.slice(0, 16 + size);
  const head = JSON.parse(text(rest, 16, 16 + size));
  const index = (await fromEnd(file)) ?? (await walked(file, 16 + size));
  return reader(file, head, index);
}

/** Where frames are, by the index at the end of a whole file. */
async function fromEnd(file) {
  const end = file.length();
  const last = await file.slice(end - 16, end);
  if (text(last, 0, 4) !== "LAST") return null;
  const at = Number(new DataView(last).getBigUint64(8, true));
  const chunk = await file.slice(at, end - 16);
  const view = new DataView(chunk), count = view.getUint32(4, true) / 24;
  const index = Array.from({ length: count }, (_, k) => ({ at: Number(view.getBigUint64(8 + 24 * k, true)), simulated_s: view.getFloat64(16 + 24 * k, true), t_s: view.getFloat64(24 + 24 * k, true) }));
  index.forEach((one, k) => (one.end = index[k + 1]?.at ?? at));
  return index;
}

/** The same of a file that was broken off or still grows: from chunk to chunk, as far as they are whole. */
async function walked(file, from) {
  const index = [];
  for (let at = from; at + 24 <= file.length(); ) {
    const view = new DataView(await file.slice(at, at + 24));
    const end = at + 8 + view.getUint32(4, true);
    if (end > file.length()) break;
    if (view.getUint32(0, false) === 0x4652414d) index.push({ at, end, simulated_s: view.getFloat64(8, true), t_s: view.getFloat64(16, true) });
    at = end;
  }
  return index;
}

function reader(file, head, index) {
  const thread = new Worker("/dashboard/playback/unpack.js");
  thread.postMessage({ counts: head.bodies.map((kind) => head.kinds[kind].subparticles) });
  const waiting = new Map(), kept = new Map();
  thread.onmessage = ({ data: { id, frame, error } }) => {
    const { done, failed } = waiting.get(id);
    waiting.delete(id);
    if (error) failed(new Error(`frame ${id} cannot be unpacked: ${error}`));
    else done(frame);
  };
  const total = head.bodies.reduce((sum, kind) => sum + head.kinds[kind].subparticles, 0);
  const most = Math.max(12, Math.floor(MOST_BYTES / (BYTES_EACH * Math.max(1, total))));

  /** Frame k; the least recently asked for is forgotten first. */
  function frame(k) {
    const found = kept.get(k) ?? load(k);
    kept.delete(k);
    kept.set(k, found);
    while (kept.size > most) kept.delete(kept.keys().next().value);
    // What could not be read may be asked for again.
    found.catch(() => kept.get(k) === found && kept.delete(k));
    return found;
  }
  async function load(k) {
    const chunk = await file.slice(index[k].at, index[k].end);
    return new Promise((done, failed) => {
      waiting.set(k, { done, failed });
      thread.postMessage({ id: k, chunk }, [chunk]);
    });
  }
  /** Loads what comes next, so that it is there when it is time. */
  const ahead = (k, count = 6) => {
    for (let next = k + 1; next <= Math.min(k + count, index.length - 1); next++) if (!kept.has(next)) frame(next).catch(() => {});
  };
  return { head, index, total, frame, ahead, end: () => thread.terminate() };
}
