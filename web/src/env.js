/** Where the WebAssembly of the decoder and its workers come from, in browsers. Node has its own way: `node/env.js`. */

import * as wasm from '../wasm/decoder.js';
import { handlerOf } from './handler.js';

/** Compiled modules, by address. */
const compiled = new Map();

/**
 * How parts of the package are loaded. Bundlers find a worker by `new Worker(new URL(...))` as it
 * stands in the text; webpack makes one of those with the same name.
 * @typedef {object} Platform
 * @property {(url: URL) => Promise<WebAssembly.Module>} compile
 * @property {() => Worker} worker starts a worker that decodes
 * @property {() => Worker} filesWorker starts a worker that decodes files whole
 * @property {boolean} hasWorkers
 * @property {(source: unknown) => object | undefined} source a source of bytes that only this platform knows
 */

/** @type {Platform} */
let platform = {
  compile: compileFetched,
  worker: () => new Worker(new URL('./worker.js', import.meta.url), { type: 'module', name: 'lexisplat-decoder' }),
  filesWorker: () => new Worker(new URL('./files-worker.js', import.meta.url), { type: 'module', name: 'lexisplat-files' }),
  hasWorkers: typeof Worker !== 'undefined',
  source: () => undefined,
};

/** Loads the parts of the package in another way from now on. @param {Platform} other */
export function setPlatform(other) {
  platform = other;
}

/** The environment of the npm package: files beside this one. */
export async function environment() {
  const module = await compiledAt(new URL('../wasm/decoder_bg.wasm', import.meta.url));
  wasm.initSync({ module });
  const { worker, hasWorkers, source } = platform;
  return { wasm, module, handler: () => handlerOf(wasm), worker, hasWorkers, source, files };
}

/** The same for files that are decoded whole. It is loaded when there is one. */
async function files() {
  const module = await compiledAt(new URL('../wasm/files_bg.wasm', import.meta.url));
  const wasm = await import('../wasm/files.js');
  wasm.initSync({ module });
  return { module, handler: () => handlerOf(wasm), worker: platform.filesWorker };
}

/** The module at `url`, compiled once. */
async function compiledAt(url) {
  if (!compiled.has(url.href)) compiled.set(url.href, platform.compile(url));
  return compiled.get(url.href).catch((error) => {
    compiled.delete(url.href);
    throw error;
  });
}

async function compileFetched(url) {
  const response = await fetch(url);
  if (!response.ok) throw new Error(`lexisplat: ${url}: the server answered ${response.status}`);
  // A server that does not know the type of .wasm files is not a reason to fail.
  const isTyped = response.headers.get('content-type')?.startsWith('application/wasm');
  return isTyped ? WebAssembly.compileStreaming(response) : WebAssembly.compile(await response.arrayBuffer());
}
