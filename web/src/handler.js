/** Handles a message in a worker, or in the calling thread where there are no workers. */

import { rowsOf } from './rows.js';

/**
 * @param {object} wasm the exports of the decoder's WebAssembly
 * @param {(chunk: object) => object} [gpu] the arrays of a chunk `as: 'gpu'`
 * @returns {(message: object) => {reply: object, transfer: ArrayBuffer[]}}
 */
export function handlerOf(wasm, gpu) {
  let decoder;
  const answers = {
    start({ name, start, shParts }) {
      decoder?.free();
      decoder = new wasm.Decoder(name, start, shParts);
      return {};
    },
    job({ job, as }) {
      return arraysOf(decoder.decode(job), as, gpu);
    },
    whole({ name, bytes, as }) {
      const whole = new wasm.Whole(name, bytes);
      try {
        const header = JSON.parse(whole.header());
        const chunk = whole.chunk();
        const dictionary = chunk.dictionary();
        return { header, dictionary, chunk: arraysOf(chunk, as, gpu) };
      } finally {
        whole.free();
      }
    },
  };
  return (message) => {
    const reply = answers[message.type](message);
    const transfer = [];
    collect(reply, transfer);
    return { reply, transfer };
  };
}

/** The arrays of a decoded chunk, which is freed. */
function arraysOf(chunk, as, gpu) {
  try {
    if (as === 'gpu') return { first: chunk.first, count: chunk.count, ...gpu(chunk) };
    const arrays = {
      first: chunk.first,
      count: chunk.count,
      positions: chunk.positions(),
      scales: chunk.scales(),
      rotations: chunk.rotations(),
      opacities: chunk.opacities(),
      dc: chunk.dc(),
    };
    if (as === 'dense') arrays.sh = chunk.dense();
    if (as === 'rows') arrays.rows = rowsOf(arrays);
    if (as === 'codes') {
      arrays.codes = {
        counts: chunk.counts(),
        indices: chunk.narrow_indices() ?? chunk.wide_indices(),
        values: chunk.half_values() ?? chunk.full_values(),
        escapes: { gaussians: chunk.escapes(), rows: chunk.escape_rows() },
      };
    }
    return arrays;
  } finally {
    chunk.free();
  }
}

/** Adds the buffers of all arrays in `value`, which are handed over and not copied. */
function collect(value, buffers) {
  if (ArrayBuffer.isView(value)) buffers.push(value.buffer);
  else if (value && typeof value === 'object') Object.values(value).forEach((v) => collect(v, buffers));
}
