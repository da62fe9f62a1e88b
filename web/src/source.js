/**
 * Where the bytes of a file come from: an address, a Blob or bytes in memory.
 *
 * A source gives pieces of the file from any offset on. An address is fetched once from its start, and by ranges where bytes
 * are to be skipped and the server has ranges. A source also gives ranges, several at the same time.
 */

import { whyUnreachable } from './unreachable.js';

/** Bytes of a Blob or of memory that are handed on at once. */
const PIECE = 1 << 20;
/** Fewer bytes than this are fetched and dropped rather than skipped by another request. */
const WORTH_SKIPPING = 256 << 10;
/** Milliseconds without a byte after which a download has stalled, and between two times that this is told. */
const STALLED = 5000;
const TOLD_EVERY = 1000;

/**
 * @param {string | URL | Blob | ArrayBuffer | ArrayBufferView} source
 * @returns {Source}
 */
export function sourceOf(source) {
  if (typeof source === 'string' || source instanceof URL) return new Address(source);
  if (typeof Blob !== 'undefined' && source instanceof Blob) return new BlobSource(source);
  if (source instanceof ArrayBuffer) return new Memory(new Uint8Array(source));
  if (ArrayBuffer.isView(source)) {
    return new Memory(new Uint8Array(source.buffer, source.byteOffset, source.byteLength));
  }
  throw new TypeError('lexisplat: a source is an address, a Blob, an ArrayBuffer or bytes');
}

/**
 * Tells `options.onProgress` when no bytes of `source` come for a while, too.
 * @param {object} source of `sourceOf`
 * @param {object} options
 * @returns {object} the options to go on with
 */
export function watched(source, options) {
  const { onProgress } = options;
  if (!onProgress) return options;
  let last = { loaded: 0, total: undefined, decoded: 0, gaussians: 0 };
  source.onStall = (stalled) => onProgress({ ...last, stalled });
  return { ...options, onProgress: (progress) => onProgress((last = progress)) };
}

/** `source`, whose first bytes were read already and are given again. */
export function after(bytes, source) {
  return {
    name: source.name,
    get size() {
      return source.size;
    },
    read: async (at, signal) => (at < bytes.length ? bytes.subarray(at) : source.read(at, signal)),
    hasRanges: (signal) => source.hasRanges(signal),
    range: (from, to, signal) => source.range(from, to, signal),
    close: () => source.close(),
  };
}

/**
 * Gives `feed` the bytes that it wants next, as far as they come at once.
 * @returns {Promise<number | undefined>} the offset in the file after them; undefined if it wants none
 */
export async function feedOnce(feed, source, signal) {
  const wanted = feed.wants();
  if (!wanted) return undefined;
  const [from, to] = wanted;
  const piece = await source.read(from, signal);
  if (!piece) throw new Error(`${source.name}: the file ends after ${from} bytes, before it is whole`);
  const taken = piece.subarray(0, to - from);
  feed.feed(from, taken);
  return from + taken.length;
}

class Memory {
  name = 'scene.lexi';

  constructor(bytes) {
    this.bytes = bytes;
    this.size = bytes.length;
  }

  /** Returns the bytes from `at` on, at most a piece of them, or null at the end of the file. */
  async read(at) {
    return at < this.size ? this.bytes.subarray(at, at + PIECE) : null;
  }

  hasRanges = async () => true;

  async range(from, to) {
    return checked(this, from, to, this.bytes.subarray(from, to));
  }

  close() {}
}

class BlobSource {
  constructor(blob) {
    this.blob = blob;
    this.name = blob.name ?? 'scene.lexi';
    this.size = blob.size;
  }

  async read(at) {
    if (at >= this.size) return null;
    return new Uint8Array(await this.blob.slice(at, at + PIECE).arrayBuffer());
  }

  hasRanges = async () => true;

  async range(from, to) {
    return checked(this, from, to, new Uint8Array(await this.blob.slice(from, to).arrayBuffer()));
  }

  close() {}
}

/** `bytes`, if they are as many as were asked for. */
function checked({ name }, from, to, bytes) {
  if (bytes.length === to - from) return bytes;
  throw new Error(`${name}: ${bytes.length} bytes came of those from ${from} to ${to}`);
}

class Address {
  size = undefined;
  /** Is told for how many milliseconds no bytes came. */
  onStall = undefined;
  #address;
  #controller;
  #reader;
  /** The offset in the file of the next byte of the running request, and the piece that came before it. */
  #at = 0;
  #piece = new Uint8Array(0);
  #ranges = false;

  constructor(address) {
    this.#address = address;
    const path = String(address).split(/[?#]/)[0];
    this.name = path.startsWith('data:') || path.startsWith('blob:') ? 'scene' : decoded(path.slice(path.lastIndexOf('/') + 1)) || 'scene';
  }

  async read(at, signal) {
    const before = this.#at - this.#piece.length;
    // The part of the last piece that was not taken is given again.
    if (this.#reader && at >= before && at < this.#at) return this.#piece.subarray(at - before);
    const skipped = at - this.#at;
    if (!this.#reader || skipped < 0 || (skipped > WORTH_SKIPPING && this.#ranges)) await this.#request(at, signal);
    for (;;) {
      const piece = await this.#next();
      if (!piece) return null;
      const start = this.#at;
      this.#at += piece.length;
      this.#piece = piece;
      // The wanted bytes may begin within the piece, or after it.
      if (this.#at > at) return at > start ? piece.subarray(at - start) : piece;
    }
  }

  async #next() {
    try {
      const { done, value } = await this.#awaited(this.#reader.read());
      if (!done) return value;
    } catch (cause) {
      throw this.#cut(cause);
    }
    if (this.size !== undefined && this.#at < this.size) throw this.#cut();
    return null;
  }

  /** Waits for `work`, and tells when it takes long. */
  async #awaited(work) {
    if (!this.onStall) return work;
    let waited = 0;
    const timer = setInterval(() => {
      waited += TOLD_EVERY;
      if (waited >= STALLED) this.onStall?.(waited);
    }, TOLD_EVERY);
    try {
      return await work;
    } finally {
      clearInterval(timer);
    }
  }

  #cut(cause) {
    if (cause?.name === 'AbortError') return cause;
    const of = this.size === undefined ? '' : ` of ${this.size}`;
    return new Error(`${this.name}: the connection was cut after ${this.#at}${of} bytes`, { cause });
  }

  async #request(at, signal) {
    this.close();
    this.#controller = new AbortController();
    const stop = () => this.#controller?.abort(signal.reason);
    if (signal?.aborted) stop();
    signal?.addEventListener('abort', stop, { once: true });
    const response = await this.#answer(at > 0 ? `bytes=${at}-` : undefined, this.#controller.signal);
    // A server without ranges sends the file from its start.
    this.#at = response.status === 206 ? at : 0;
    this.#piece = new Uint8Array(0);
    if (response.status === 200) {
      const length = Number(response.headers.get('content-length'));
      // The length of compressed content is not that of the file.
      this.size = length > 0 && !response.headers.get('content-encoding') ? length : undefined;
    }
    this.#ranges = response.status === 206 || response.headers.get('accept-ranges') === 'bytes';
    this.#reader = response.body.getReader();
  }

  async #answer(range, signal) {
    let response;
    try {
      const headers = range ? { Range: range } : {};
      response = await this.#awaited(fetch(this.#address, { headers, signal }));
    } catch (cause) {
      if (signal?.aborted) throw signal.reason;
      throw new Error(`${this.name}: ${await whyUnreachable(this.#address, cause)}`, { cause });
    }
    if (response.ok && response.body) return response;
    throw new Error(`${this.name}: the server answered ${response.status} ${response.statusText}`.trim());
  }

  /** Whether the server gives ranges. Some do not tell before they are asked for one. */
  async hasRanges(signal) {
    const response = await this.#answer('bytes=0-0', signal);
    await response.body.cancel();
    return response.status === 206;
  }

  /** Returns the bytes from `from` to before `to`. The running request from the start of the file ends. */
  async range(from, to, signal) {
    this.close();
    const response = await this.#answer(`bytes=${from}-${to - 1}`, signal);
    if (response.status !== 206) {
      await response.body.cancel();
      throw new Error(`${this.name}: the server has no ranges`);
    }
    let bytes;
    try {
      bytes = new Uint8Array(await this.#awaited(response.arrayBuffer()));
    } catch (cause) {
      if (signal?.aborted) throw signal.reason;
      throw new Error(`${this.name}: the connection was cut`, { cause });
    }
    return checked(this, from, to, bytes);
  }

  close() {
    this.#controller?.abort();
    this.#controller = undefined;
    this.#reader = undefined;
  }
}

/** The text of a part of an address. */
function decoded(text) {
  try {
    return decodeURIComponent(text);
  } catch {
    return text;
  }
}
