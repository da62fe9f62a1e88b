// Where the program's parts are if they are files of one folder.

// Workers that decode a scene. More leave no processor to the page on phones.
const WORKERS = 2;

/** @type {import('./engine.js').Program} */
export const folder = {
  compile: () => compiled(new URL('../../wasm/viewer_bg.wasm', import.meta.url)),
  worker: () => new Worker(new URL('../viewer-worker.js', import.meta.url), { type: 'module', name: 'lexisplat-viewer' }),
  workers: WORKERS,
  processor: {
    compile: () => compiled(new URL('../../wasm/processor_bg.wasm', import.meta.url)),
    worker: () => new Worker(new URL('../processor-worker.js', import.meta.url), { type: 'module', name: 'lexisplat-processor' }),
  },
};

async function compiled(address) {
  const answer = await fetch(address);
  if (!answer.ok) throw new Error(`The viewer's program could not be loaded (${answer.status}).`);
  // compileStreaming refuses what a server sends under another type than application/wasm.
  return WebAssembly.compile(await answer.arrayBuffer());
}
