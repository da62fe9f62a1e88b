/** Where the WebAssembly of the decoder and its workers come from. */

import * as wasm from '../wasm/decoder.js';
import { handlerOf } from './handler.js';
import { startWorker } from './pool.js';

/** What was compiled, by its address. */
const compiled = new Map();

/** The environment of the npm package: files beside this one. */
export async function environment() {
  const module = await compiledAt(new URL('../wasm/decoder_bg.wasm', import.meta.url));
  wasm.initSync({ module });
  return {
    wasm,
    module,
    handler: () => handlerOf(wasm),
    worker: () => startWorker(new URL('./worker.js', import.meta.url)),
    files,
  };
}

/** The same for files that are decoded whole. It is loaded when there is one. */
async function files() {
  const module = await compiledAt(new URL('../wasm/files_bg.wasm', import.meta.url));
  const wasm = await import('../wasm/files.js');
  wasm.initSync({ module });
  return {
    module,
    handler: () => handlerOf(wasm),
    worker: () => startWorker(new URL('./files-worker.js', import.meta.url)),
  };
}

/** The module at `url`, compiled once. */
async function compiledAt(url) {
  if (!compiled.has(url.href)) compiled.set(url.href, compile(url));
  return compiled.get(url.href).catch((error) => {
    compiled.delete(url.href);
    throw error;
  });
}

async function compile(url) {
  if (url.protocol === 'file:' && typeof process !== 'undefined') {
    const { readFile } = await import('node:fs/promises');
    return WebAssembly.compile(await readFile(url));
  }
  const response = await fetch(url);
  if (!response.ok) throw new Error(`lexisplat: ${url}: the server answered ${response.status}`);
  // A server that does not know the type of .wasm files is not a reason to fail.
  const isTyped = response.headers.get('content-type')?.startsWith('application/wasm');
  return isTyped ? WebAssembly.compileStreaming(response) : WebAssembly.compile(await response.arrayBuffer());
}
