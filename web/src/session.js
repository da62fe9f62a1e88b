/**
 * Brings a scene of any format to the viewer: .lexi files coarse to fine while they come, and large ones as far as a view
 * shows them within a budget; others whole.
 */

import * as wasm from '../wasm/viewer.js';
import { ALL_PARTS, MEMORY, PACKED, readStart, readWhole, startDecoders, startFeed } from './open.js';
import { Pool } from './pool.js';
import { streamed } from './scene.js';
import { sourceOf, watched } from './source.js';
import { Stream } from './stream.js';
import { viewerHandlerOf } from './viewer-handler.js';

/** Bytes of a Gaussian that is drawn, besides its nonzeros: position and size, shape, base colour, and its index among codes. */
const GEOMETRY = 16 + 32 + 12 + 2;
/** Bytes of a nonzero, and how many a Gaussian has at most on average in files that were met. */
const NONZERO = 3;
const NONZEROS = 8;
/** Bytes of a coefficient of dense SH, whose rows are filled up to four. */
const COEFFICIENT = 4;
/** Of the memory for a scene and its drawing, the share that the scene may take. The rest is for what it is drawn with. */
const SCENE_SHARE = 0.75;
/** No limit of what is drawn of a scene. */
const UNLIMITED = { splats: Infinity, bytes: Infinity };

/**
 * @param {string | URL | Blob | ArrayBuffer | ArrayBufferView} source
 * @param {object} options
 * @param {{wasm: WebAssembly.Module, worker: () => Worker, workers: number}} options.env
 * @param {(bytes: Uint8Array, info: object) => unknown} options.onForm takes what `Viewer.form` takes
 * @param {(index: number, bytes: Uint8Array) => unknown} options.onPart takes what `Viewer.part` takes
 * @param {(change: {removed: number[], parts: object[]}) => Promise<unknown>} [options.onChange] shows a change of a scene of which
 *     a part is drawn: removes parts by their numbers, and then takes `part` as number `index` for each of `parts`
 * @param {(stream: Stream) => void} [options.onStream] takes the stream of such a scene, which goes on until `signal` ends it
 * @param {(error: unknown) => void} [options.onFail] is told why a stream ended after it was whole
 * @param {(progress: object) => void} [options.onProgress]
 * @param {AbortSignal} [options.signal]
 * @param {import('./stream.js').Budget} [options.budget] most Gaussians that are drawn, and bytes of a .lexi that are held. Of a
 *     packed file with more Gaussians, only what a view shows is drawn.
 * @param {number} [options.memory] most bytes that the scene and its drawing may take
 * @returns {Promise<{info: object}>}
 */
export async function show(source, { env, onProgress, signal, budget = UNLIMITED, memory = Infinity, ...on }) {
  const input = { source: sourceOf(source), feed: undefined };
  let pool;
  const report = (progress) => onProgress?.({ ms: pool?.milliseconds ?? 0, ...progress });
  const options = watched(input.source, { memory: MEMORY, shParts: ALL_PARTS, signal, onProgress: report });
  let stream;
  let starting;
  const close = () => {
    input.source.close();
    input.feed?.free();
    starting?.then((pool) => pool.close()).catch(() => {});
  };
  try {
    signal?.throwIfAborted();
    // Workers start while the first bytes come.
    starting = Pool.of(env.workers, { module: env.wasm, worker: env.worker, handler: () => viewerHandlerOf(wasm) });
    starting.catch(() => {});
    const start = await readStart(input.source, signal);
    pool = await starting;
    const given = { input, start, pool, options, memory, ...on };
    if (start.version !== PACKED) return { info: await whole(given) };
    const header = await startFeed(input, wasm, start, options);
    await startDecoders(pool, input, options);
    const splats = Math.min(budget.splats, mostGaussians(memory));
    if (header.gaussians <= splats || !(await input.source.hasRanges(signal))) {
      return { info: await layered({ ...given, header: { ...header, view: start.view }, splats }) };
    }
    let info;
    ({ stream, info } = within({ ...given, header: { ...header, view: start.view }, budget: { ...budget, splats } }));
    on.onStream?.(stream);
    stream.run().finally(close).catch((error) => stream.isWhole && on.onFail?.(error));
    await stream.whole;
    return { info };
  } finally {
    if (!stream) close();
  }
}

/** Shows a packed file while it comes, at most `splats` Gaussians. */
async function layered({ input, pool, options, header, splats, onForm, onPart }) {
  const { name } = input.source;
  const shown = input.feed.give_up(Math.min(header.gaussians, splats));
  if (shown === 0 && header.gaussians > 0) throw new Error(`${name}: its first chunk has more than the ${splats} Gaussians that there is room for`);
  const info = { ...header, name, shown };
  let isFormed = false;
  for await (const chunk of streamed({ ...input, pool, options, as: 'gpu', refine: true })) {
    if (!isFormed) await onForm(chunk.form, info);
    isFormed = true;
    await onPart(chunk.index, chunk.part);
  }
  return info;
}

/** Begins to show what a view shows of a packed file. */
function within({ input, pool, options, header, budget, onForm, onChange }) {
  const { source, feed } = input;
  // The stream takes what came to the feed.
  const core = new wasm.Stream(feed);
  input.feed = undefined;
  let isFormed = false;
  const change = async ({ removed, parts }) => {
    if (!isFormed && parts.length > 0) await onForm(parts[0].form, info);
    isFormed ||= parts.length > 0;
    await onChange({ removed, parts });
  };
  const progress = () => {
    if (stream.isWhole) return;
    const { bytes, held, drawn, splats } = stream.state;
    options.onProgress?.({ loaded: Math.min(bytes, held), total: bytes, decoded: drawn, gaussians: splats });
  };
  const stream = new Stream({ source, core, pool, budget, signal: options.signal }, { change, progress });
  const info = { ...header, name: source.name, shown: stream.state.splats, budget: budget.splats };
  return { stream, info };
}

function mostGaussians(memory) {
  return Math.floor((memory * SCENE_SHARE) / (GEOMETRY + NONZERO * NONZEROS));
}

/** Shows a file that is read whole. */
async function whole({ input: { source }, start, pool, options, memory, onForm, onPart }) {
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
      info = { ...head, name, shown: head.gaussians, view: start.view };
      const needed = head.gaussians * (GEOMETRY + COEFFICIENT * 4 * Math.ceil((3 * (head.degree + 1) ** 2) / 4));
      if (needed > memory * SCENE_SHARE) {
        throw new Error(`${name}: it takes ${needed} bytes of memory as it is, and ${memory} are allowed; a .lexi made of it takes less`);
      }
      take(() => onForm(form, info));
    } else {
      decoded += count;
      take(() => onPart(index, part));
    }
    options.onProgress({ ms: performance.now() - clock, loaded, total: loaded, decoded, gaussians: info.gaussians });
  });
  await taken;
  if (refusal) throw refusal;
  return info;
}
