/** Reads the start of a file and tells how the rest is decoded. */

import { Pool } from './pool.js';
import { Scene } from './scene.js';
import { after, feedOnce, sourceOf, watched } from './source.js';

/** Most bytes of a file that are held at once, unless options say otherwise. */
export const MEMORY = 256 << 20;
/** Workers, unless options say otherwise. */
const WORKERS = 2;
/** Parts of SH-rest, unless options say otherwise: all. */
export const ALL_PARTS = 0xffffffff;
/** Most bytes of the JSON header of a file. */
const MOST_HEADER = 4 << 20;
/** The version of packed files, which are decoded in part. */
export const PACKED = '3';

/**
 * @param {object} env where WebAssembly and workers come from
 * @returns {Promise<Scene>}
 */
export async function openWith(env, source, options) {
  const input = { source: env.source(source) ?? sourceOf(source), feed: undefined };
  // An option that is undefined is one that is not given.
  const given = Object.entries(options ?? {}).filter(([, value]) => value !== undefined);
  const settings = watched(input.source, { memory: MEMORY, shParts: ALL_PARTS, ...Object.fromEntries(given) });
  const { signal } = settings;
  signal?.throwIfAborted();
  const workers = settings.workers ?? (env.hasWorkers ? WORKERS : 0);
  // Workers start while the first bytes come.
  const starting = Pool.of(workers, env);
  const stop = () => starting.then((pool) => pool.close()).catch(() => {});
  let pool;
  try {
    const start = await readStart(input.source, signal);
    if (start.version !== PACKED) {
      if (start.version === undefined) throw new Error(`${input.source.name}: this is not a .lexi file`);
      stop();
      pool = await Pool.of(Math.min(workers, 1), await env.files());
      return await wholeScene({ input, settings, pool, start });
    }
    const header = await startFeed(input, env.wasm, start, settings);
    pool = await starting;
    await startDecoders(pool, input, settings);
    const dictionary = { atoms: header.atoms, rest: restOf(header.degree), values: input.feed.dictionary() };
    return new Scene({ input, options: settings, header: { ...header, view: start.view }, dictionary, pool });
  } catch (error) {
    input.source.close();
    input.feed?.free();
    pool?.close();
    stop();
    throw error;
  }
}

/**
 * Gives `input` a feed, which has what `start` is of its source and as much more as its header takes.
 * @returns {Promise<object>} the header
 */
export async function startFeed(input, wasm, start, { memory, shParts, signal }) {
  const feed = new wasm.Feed(input.source.name, memory, shParts);
  input.feed = feed;
  input.source = after(start.bytes, input.source);
  while (feed.header() === undefined) await feedOnce(feed, input.source, signal);
  return JSON.parse(feed.header());
}

/** Tells all workers the start of the file that they decode chunks of. */
export async function startDecoders(pool, { source: { name }, feed }, { shParts }) {
  await pool.askAll({ type: 'start', name, start: feed.start(), shParts });
}

/** Values of SH-rest at a degree. */
export function restOf(degree) {
  return 3 * ((degree + 1) ** 2 - 1);
}

/** How a web page begins, which some servers send for every address that they do not know. */
const WEB_PAGE = /^\s*<(!doctype html|html)/i;

/**
 * The first bytes of a file, and, if it is a .lexi, its version and the view from which it is shown first.
 * @throws {Error} if the file is empty, or a web page
 */
export async function readStart(source, signal) {
  let bytes = new Uint8Array(0);
  const reach = async (length) => {
    while (bytes.length < length) {
      const piece = await source.read(bytes.length, signal);
      if (!piece) return false;
      const longer = new Uint8Array(bytes.length + piece.length);
      longer.set(bytes);
      longer.set(piece, bytes.length);
      bytes = longer;
    }
    return true;
  };
  const LENGTH = 8;
  const isLong = await reach(LENGTH + 1);
  if (bytes.length === 0) throw new Error(`${source.name}: the file is empty`);
  if (WEB_PAGE.test(new TextDecoder().decode(bytes.subarray(0, 64)))) {
    throw new Error(`${source.name}: this is a web page, not a scene; servers send one where there is no file`);
  }
  // A .lexi begins with the length of a JSON object and the object.
  if (!isLong || bytes[LENGTH] !== 0x7b) return { bytes, version: undefined };
  const view = new DataView(bytes.buffer);
  const length = view.getUint32(0, true);
  if (view.getUint32(4, true) > 0 || length > MOST_HEADER || !(await reach(LENGTH + length))) return { bytes, version: undefined };
  try {
    const header = JSON.parse(new TextDecoder().decode(bytes.subarray(LENGTH, LENGTH + length)));
    const { version, view } = header.__metadata__ ?? {};
    return { bytes, version, view };
  } catch {
    return { bytes, version: undefined };
  }
}

/** The rest of a file after its first bytes. */
export async function readWhole(source, first, { memory, signal, onProgress }) {
  const pieces = [first];
  let length = first.length;
  const most = Math.max(memory, MEMORY);
  for (;;) {
    if (length > most) throw new Error(`${source.name}: more than ${most} bytes: too many for a file that is decoded whole`);
    const piece = await source.read(length, signal);
    if (!piece) break;
    pieces.push(piece);
    length += piece.length;
    onProgress?.({ loaded: length, total: source.size, decoded: 0, gaussians: 0 });
  }
  const bytes = new Uint8Array(length);
  let at = 0;
  for (const piece of pieces) {
    bytes.set(piece, at);
    at += piece.length;
  }
  return bytes;
}

/** A scene of a file of an exact layout, which is decoded whole. */
async function wholeScene({ input, settings, pool, start }) {
  const { source } = input;
  const bytes = await readWhole(source, start.bytes, settings);
  // The header is known only once the file is decoded; what it is decoded to is chosen later, so bytes are kept until then.
  const ask = (as, transfer) => pool.ask({ type: 'whole', name: source.name, bytes: transfer ? bytes : bytes.slice(), as }, transfer ? [bytes.buffer] : []);
  const { header, dictionary } = await ask('none', false);
  const scene = { atoms: header.atoms, rest: restOf(header.degree), values: dictionary };
  const whole = async (as) => {
    settings.signal?.throwIfAborted();
    const { chunk } = await ask(as, true);
    settings.onProgress?.({ loaded: header.bytes, total: header.bytes, decoded: chunk.count, gaussians: chunk.count });
    return { index: 0, layer: 0, complete: true, ...chunk };
  };
  return new Scene({ input, options: settings, header: { version: Number(start.version), ...header, view: start.view }, dictionary: scene, whole, pool });
}
