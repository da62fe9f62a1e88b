/** Files of this computer as sources of bytes. */

import { open } from 'node:fs/promises';
import { basename } from 'node:path';
import { fileURLToPath } from 'node:url';

/** Bytes that are read at once. */
const PIECE = 1 << 20;
/** The beginning of an address. A single letter is a drive of Windows. */
const SCHEME = /^[a-z][a-z0-9+.-]+:/i;

/**
 * @param {unknown} source a path, or a `file:` address
 * @returns {FileSource | undefined} undefined for what is neither
 */
export function fileOf(source) {
  const isFile = source instanceof URL ? source.protocol === 'file:' : typeof source === 'string' && /^file:/i.test(source);
  if (isFile) return new FileSource(fileURLToPath(source));
  if (typeof source === 'string' && !SCHEME.test(source)) return new FileSource(source);
  return undefined;
}

/** A file, which is opened when it is first read. */
class FileSource {
  size = undefined;
  #path;
  #opened;

  constructor(path) {
    this.#path = path;
    this.name = basename(path);
  }

  /** Returns the bytes from `at` on, at most a piece of them, or null at the end of the file. */
  async read(at, signal) {
    signal?.throwIfAborted();
    this.#opened ??= this.#open();
    const file = await this.#opened;
    const { bytesRead, buffer } = await file.read(new Uint8Array(PIECE), 0, PIECE, at);
    return bytesRead > 0 ? buffer.subarray(0, bytesRead) : null;
  }

  async #open() {
    let file;
    try {
      file = await open(this.#path);
      const stat = await file.stat();
      if (!stat.isFile()) throw new Error('it is not a file');
      this.size = stat.size;
      return file;
    } catch (cause) {
      await file?.close();
      const why = cause.code === 'ENOENT' ? 'there is no such file' : cause.code === 'EACCES' ? 'it may not be read' : cause.message;
      throw new Error(`${this.#path}: ${why}`, { cause });
    }
  }

  close() {
    this.#opened?.then((file) => file.close()).catch(() => {});
    this.#opened = undefined;
  }
}
