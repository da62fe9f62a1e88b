/** A scene that is open: its header, its dictionary, and its chunks as they are decoded. */

import { feedOnce } from './source.js';

/** Most chunks that are decoded and not taken yet, besides those in work. */
const AHEAD = 2;

/** How SH-rest of a chunk is given. */
const FORMS = ['codes', 'dense', 'rows'];

export class Scene {
  header;
  dictionary;
  #input;
  #options;
  #pool;
  #whole;
  #used = false;

  constructor({ input, options, header, dictionary, whole, pool }) {
    this.header = header;
    this.dictionary = dictionary;
    this.#input = input;
    this.#options = options;
    this.#whole = whole;
    this.#pool = pool;
  }

  async *chunks({ as = 'codes', refine = false } = {}) {
    if (!FORMS.includes(as)) throw new TypeError(`lexisplat: as is ${FORMS.join(', ')}, not ${as}`);
    if (this.#used) throw new Error('lexisplat: the chunks of a scene are given once; open it again');
    this.#used = true;
    if (this.#whole) {
      yield await this.#whole(as);
      return;
    }
    yield* streamed({ ...this.#input, pool: this.#pool, options: this.#options, as, refine });
  }

  async all({ as = 'codes' } = {}) {
    const chunks = [];
    for await (const chunk of this.chunks({ as })) chunks.push(chunk);
    chunks.sort((a, b) => a.first - b.first);
    return joined(chunks);
  }

  close() {
    this.#used = true;
    this.#input.source.close();
    this.#input.feed?.free();
    this.#input.feed = undefined;
    this.#pool?.close();
  }
}

/**
 * Decodes the chunks of `feed` as the bytes of `source` come, and gives them as they are decoded.
 *
 * @param {object} input
 * @param {object} input.source where the bytes come from
 * @param {object} input.feed takes them
 * @param {Pool} input.pool decodes
 */
export async function* streamed({ source, feed, pool, options, as, refine }) {
  const { signal, onProgress } = options;
  const header = JSON.parse(feed.header());
  const total = header.bytes;
  let loaded = 0;
  let decoded = 0;
  const ready = [];
  const inWork = new Set();
  const seen = new Set();
  let failure;
  let reading;
  let isRead = false;

  const report = () => onProgress?.({ loaded, total, decoded, gaussians: header.gaussians });
  // Reads one piece. Bytes for which the feed has no room are read when chunks were decoded.
  const read = async () => {
    const end = (await feedOnce(feed, source, signal)) ?? (feed.ask_again() ? await feedOnce(feed, source, signal) : undefined);
    if (end === undefined) {
      isRead = true;
      return;
    }
    loaded = Math.max(loaded, end);
    report();
  };
  const start = (chunk) => {
    const isFinal = !refine || feed.is_final(chunk);
    const job = feed.job(chunk, refine);
    // There may be room for more bytes now.
    isRead = false;
    const work = pool.ask({ type: 'job', job, as }, [job.buffer]).then((arrays) => {
      if (!seen.has(chunk)) decoded += arrays.count;
      seen.add(chunk);
      ready.push({ index: chunk, layer: feed.layer(chunk), complete: isFinal, ...arrays });
      report();
    });
    inWork.add(work);
    work.catch((error) => (failure ??= error)).finally(() => inWork.delete(work));
  };

  try {
    for (;;) {
      if (signal?.aborted) throw signal.reason;
      if (failure) throw failure;
      while (ready.length + inWork.size < pool.size + AHEAD && pool.free > 0) {
        const chunk = feed.next(refine, reading !== undefined && inWork.size === 0);
        if (chunk === undefined) break;
        start(chunk);
      }
      if (ready.length > 0) {
        yield ready.shift();
        continue;
      }
      if (!reading && !isRead) {
        reading = read()
          .catch((error) => (failure ??= error))
          .finally(() => (reading = undefined));
      }
      const waits = [...inWork, reading].filter(Boolean);
      if (waits.length > 0) {
        await Promise.race(waits.map((wait) => wait.catch(() => {})));
        continue;
      }
      if (feed.is_done()) return;
      // There is no room for more bytes, or none to decode without them.
      isRead = false;
      if (!feed.wants() && !feed.ask_again() && !feed.relieve()) {
        throw new Error(`${source.name}: ${options.memory} bytes of memory are too few for its chunks`);
      }
    }
  } finally {
    // A consumer that leaves early leaves nothing running that uses the feed.
    await Promise.allSettled([...inWork, reading].filter(Boolean));
  }
}

/** Puts chunks one after another. */
function joined(chunks) {
  const [first] = chunks;
  const out = { index: 0, layer: 0, complete: true, first: 0, count: chunks.reduce((n, chunk) => n + chunk.count, 0) };
  const join = (take) => concatenated(chunks.map(take));
  if (!first) return { ...out, ...emptyArrays() };
  for (const name of ['positions', 'scales', 'rotations', 'opacities', 'dc', 'sh', 'rows']) {
    if (first[name]) out[name] = join((chunk) => chunk[name]);
  }
  if (first.codes) {
    const shifted = (chunk) => chunk.codes.escapes.gaussians.map((g) => g + chunk.first);
    out.codes = {
      counts: join((chunk) => chunk.codes.counts),
      indices: join((chunk) => chunk.codes.indices),
      values: join((chunk) => chunk.codes.values),
      escapes: { gaussians: join(shifted), rows: join((chunk) => chunk.codes.escapes.rows) },
    };
  }
  return out;
}

function emptyArrays() {
  const none = () => new Float32Array(0);
  return { positions: none(), scales: none(), rotations: none(), opacities: none(), dc: none() };
}

function concatenated(arrays) {
  const out = new arrays[0].constructor(arrays.reduce((n, array) => n + array.length, 0));
  let at = 0;
  for (const array of arrays) {
    out.set(array, at);
    at += array.length;
  }
  return out;
}
