/** Brings a scene of any format to the viewer: .lexi files coarse to fine while they come, others whole. */

import * as wasm from '../wasm/viewer.js';
import { ALL_PARTS, MEMORY, PACKED, readStart, readWhole, startDecoders, startFeed } from './open.js';
import { Pool } from './pool.js';
import { streamed } from './scene.js';
import { sourceOf, watched } from './source.js';
import { viewerHandlerOf } from './viewer-handler.js';

/** Bytes of a Gaussian on the GPU, besides its nonzeros: position and size, shape, base colour, and its place among codes. */
const GEOMETRY = 16 + 32 + 12 + 2;
/** Bytes of a nonzero, and how many a Gaussian has at most on average in files that were met. */
const NONZERO = 3;
const NONZEROS = 8;
/** Bytes of a coefficient of dense SH, whose rows are filled up to four. */
const COEFFICIENT = 4;
/** Of the budget, the share that the scene may take. The rest is for what it is drawn with. */
const SCENE_SHARE = 0.75;

/**
 * @param {string | URL | Blob | ArrayBuffer | ArrayBufferView} source
 * @param {object} options
 * @param {{wasm: WebAssembly.Module, worker: () => Worker, workers: number}} options.env
 * @param {(bytes: Uint8Array, info: object) => unknown} options.onForm takes what `Viewer.form` takes
 * @param {(index: number, bytes: Uint8Array) => unknown} options.onPart takes what `Viewer.part` takes
 * @param {(progress: object) => void} [options.onProgress]
 * @param {AbortSignal} [options.signal]
 * @param {number} options.budget most bytes on the GPU
 * @returns {Promise<{info: object}>}
 */
export async function show(source, { env, onForm, onPart, onProgress, signal, budget = Infinity }) {
  const input = { source: sourceOf(source), feed: undefined };
  let pool;
  const stats = { milliseconds: 0 };
  const report = (progress) => onProgress?.({ ...progress, ms: stats.milliseconds });
  const options = watched(input.source, { memory: MEMORY, shParts: ALL_PARTS, signal, onProgress: report });
  try {
    signal?.throwIfAborted();
    const start = await readStart(input.source, signal);
    pool = await Pool.of(start.version === PACKED ? env.workers : Math.min(env.workers, 1), {
      module: env.wasm,
      worker: env.worker,
      handler: () => viewerHandlerOf(wasm),
    });
    const given = { input, start, pool, options, stats, budget, onForm, onPart };
    return { info: await (start.version === PACKED ? layered(given) : whole(given)) };
  } finally {
    input.source.close();
    input.feed?.free();
    pool?.close();
  }
}

/** Shows a packed file while it comes. */
async function layered({ input, start, pool, options, stats, budget, onForm, onPart }) {
  const header = await startFeed(input, wasm, start, options);
  const { name } = input.source;
  const shown = input.feed.give_up(Math.min(header.gaussians, mostGaussians(budget)));
  if (shown === 0 && header.gaussians > 0) throw new Error(`${name}: ${budget} bytes of graphics memory are too few for it`);
  const info = { ...header, name, shown };
  await startDecoders(pool, input, options);
  let isFormed = false;
  for await (const chunk of streamed({ ...input, pool, options, as: 'gpu', refine: true, stats })) {
    if (!isFormed) await onForm(chunk.form, info);
    isFormed = true;
    await onPart(chunk.index, chunk.part);
  }
  return info;
}

function mostGaussians(budget) {
  return Math.floor((budget * SCENE_SHARE) / (GEOMETRY + NONZERO * NONZEROS));
}

/** Shows a file that is read whole. */
async function whole({ input: { source }, start, pool, options, stats, budget, onForm, onPart }) {
  const { name } = source;
  const bytes = await readWhole(source, start.bytes, { ...options, memory: Infinity });
  const loaded = bytes.length;
  const clock = performance.now();
  let info;
  let decoded = 0;
  let taken = Promise.resolve();
  let refusal;
  const take = (step) => (taken = taken.then(step).catch((error) => (refusal ??= error)));
  await pool.ask({ type: 'scene', name, bytes }, [bytes.buffer], ({ form, head, index, part, count }) => {
    options.signal?.throwIfAborted();
    if (form) {
      info = { ...head, name, shown: head.gaussians };
      const needed = head.gaussians * (GEOMETRY + COEFFICIENT * 4 * Math.ceil((3 * (head.degree + 1) ** 2) / 4));
      if (needed > budget * SCENE_SHARE) {
        throw new Error(`${name}: it takes ${needed} bytes of graphics memory as it is, and ${budget} are allowed; a .lexi made of it takes less`);
      }
      take(() => onForm(form, info));
    } else {
      decoded += count;
      take(() => onPart(index, part));
    }
    stats.milliseconds = performance.now() - clock;
    options.onProgress({ loaded, total: loaded, decoded, gaussians: info.gaussians });
  });
  await taken;
  if (refusal) throw refusal;
  return info;
}
