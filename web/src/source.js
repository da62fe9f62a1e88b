/**
 * Where the bytes of a file come from: an address, a Blob or bytes in memory.
 *
 * A source gives pieces of the file from any place on. An address is fetched once from its start, and by ranges where bytes
 * are to be skipped and the server has ranges.
 */

/** Bytes of a Blob or of memory that are handed on at once. */
const PIECE = 1 << 20;
/** Fewer bytes than this are fetched and dropped rather than skipped by another request. */
const WORTH_SKIPPING = 256 << 10;

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

  close() {}
}

class Address {
  size = undefined;
  #address;
  #controller;
  #reader;
  /** The place in the file of the next byte of the running request. */
  #at = 0;
  #ranges = false;

  constructor(address) {
    this.#address = address;
    const path = String(address).split(/[?#]/)[0];
    this.name = path.startsWith('data:') || path.startsWith('blob:') ? 'scene' : decoded(path.slice(path.lastIndexOf('/') + 1)) || 'scene';
  }

  async read(at, signal) {
    const skipped = at - this.#at;
    if (!this.#reader || skipped < 0 || (skipped > WORTH_SKIPPING && this.#ranges)) await this.#request(at, signal);
    for (;;) {
      const piece = await this.#next();
      if (!piece) return null;
      const start = this.#at;
      this.#at += piece.length;
      // What was asked for may begin within the piece, or after it.
      if (this.#at > at) return at > start ? piece.subarray(at - start) : piece;
    }
  }

  async #next() {
    try {
      const { done, value } = await this.#reader.read();
      if (!done) return value;
    } catch (cause) {
      throw this.#cut(cause);
    }
    if (this.size !== undefined && this.#at < this.size) throw this.#cut();
    return null;
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
    const headers = at > 0 ? { Range: `bytes=${at}-` } : {};
    let response;
    try {
      response = await fetch(this.#address, { headers, signal: this.#controller.signal });
    } catch (cause) {
      if (signal?.aborted) throw signal.reason;
      throw new Error(`${this.name}: it could not be fetched`, { cause });
    }
    if (!response.ok || !response.body) {
      throw new Error(`${this.name}: the server answered ${response.status} ${response.statusText}`.trim());
    }
    // A server without ranges sends the file from its start.
    this.#at = response.status === 206 ? at : 0;
    if (response.status === 200) {
      const length = Number(response.headers.get('content-length'));
      // The length of compressed content is not that of the file.
      this.size = length > 0 && !response.headers.get('content-encoding') ? length : undefined;
    }
    this.#ranges = response.status === 206 || response.headers.get('accept-ranges') === 'bytes';
    this.#reader = response.body.getReader();
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
