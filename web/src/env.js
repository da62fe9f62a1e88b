/** Where the WebAssembly of the decoder and its workers come from. */

import * as wasm from '../wasm/decoder.js';
import { handlerOf } from './handler.js';
import { startWorker } from './pool.js';

let compiled;

/** The environment of the npm package: files beside this one. */
export async function environment() {
  compiled ??= compile(new URL('../wasm/decoder_bg.wasm', import.meta.url));
  const module = await compiled.catch((error) => {
    compiled = undefined;
    throw error;
  });
  wasm.initSync({ module });
  return {
    wasm,
    module,
    handler: () => handlerOf(wasm),
    worker: () => startWorker(new URL('./worker.js', import.meta.url)),
  };
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
