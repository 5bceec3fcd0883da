// @ts-check
// Thread that unpacks frames (docs/frames.md), so that the page stays responsive.

/** First serial number of each body's sub-particles, and their total at the end. */
let starts = new Uint32Array(1);

onmessage = async ({ data }) => {
  if (data.counts) {
    starts = new Uint32Array(data.counts.length + 1);
    data.counts.forEach((/** @type {number} */ count, /** @type {number} */ i) => (starts[i + 1] = starts[i] + count));
    return;
  }
  try {
    const frame = await unpack(data.chunk);
    postMessage({ id: data.id, frame }, { transfer: [frame.positions.buffer, frame.speeds.buffer, frame.bodies.buffer, frame.broken.buffer] });
  } catch (error) {
    postMessage({ id: data.id, error: /** @type {Error} */ (error).message });
  }
};

/** @param {ArrayBuffer} chunk */
async function unpack(chunk) {
  const head = new DataView(chunk);
  const size = head.getUint32(4, true);
  const packed = new Blob([new Uint8Array(chunk, 32, size - 24)]);
  const body = await new Response(packed.stream().pipeThrough(new DecompressionStream("deflate"))).arrayBuffer();
  const numbers = new DataView(body), bytes = new Uint8Array(body);
  const [B, M, N] = [52, 56, 60].map((offset) => numbers.getUint32(offset, true));
  const positions = new Float32Array(3 * N), speeds = new Float32Array(N);
  let next = 64 + 8 * B + 4 * M;
  for (let axis = 0; axis < 3; axis++, next += 2 * N) {
    const low = numbers.getFloat64(8 * axis, true), step = (numbers.getFloat64(24 + 8 * axis, true) - low) / 65535;
    for (let i = 0, place = 0; i < N; i++) {
      const d = bytes[next + i] + 256 * bytes[next + N + i];
      place = (place + ((d >> 1) ^ -(d & 1))) & 65535;
      positions[3 * i + axis] = low + place * step;
    }
  }
  const top = numbers.getFloat32(48, true);
  for (let i = 0, step = 0; i < N; i++) {
    step = (step + bytes[next + i]) & 255;
    speeds[i] = top * (step / 255) ** 2;
  }
  const { bodies, broken } = owners(new Uint32Array(body, 64, B), new Uint32Array(body, 64 + 4 * B, B), new Uint32Array(body, 64 + 8 * B, M), N);
  return { simulated_s: head.getFloat64(8, true), t_s: head.getFloat64(16, true), count: N, top_m_s: top, positions, speeds, bodies, broken };
}

/**
 * The body of each sub-particle, and the number of broken bonds of that body.
 * @param {Uint32Array} numbers of the bodies @param {Uint32Array} brokenOf each body @param {Uint32Array} lost serials of lost sub-particles
 * @param {number} N
 */
function owners(numbers, brokenOf, lost, N) {
  const bodies = new Uint32Array(N), broken = new Float32Array(N);
  let i = 0, next_lost = 0;
  for (let b = 0; b < numbers.length; b++) {
    for (let serial = starts[numbers[b]]; serial < starts[numbers[b] + 1]; serial++) {
      if (lost[next_lost] === serial) next_lost++;
      else {
        [bodies[i], broken[i]] = [numbers[b], brokenOf[b]];
        i++;
      }
    }
  }
  return { bodies, broken };
}
