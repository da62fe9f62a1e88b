// The viewer compiled to WebAssembly, loaded once for all elements of a page.

/**
 * Where the program's parts are.
 * @typedef {object} Program
 * @property {() => Promise<WebAssembly.Module>} compile gives the compiled viewer
 * @property {() => Worker} worker starts a worker that decodes
 * @property {number} workers how many of them; 0 decodes on the page's thread
 */

let loading;

/** Says why this browser cannot draw, or nothing if it may. */
export function obstacle() {
  if (!globalThis.isSecureContext) return 'Browsers offer WebGPU to pages from https:// and localhost only.';
  if (!navigator.gpu) return 'This browser has no WebGPU, which draws the scene. Current Chrome, Edge, Safari and Firefox have it.';
}

/**
 * Loads the viewer. Later calls give what the first one loaded; a failure is forgotten, so that a later call tries again.
 * @param {Program} program
 * @returns {Promise<{Viewer: any, env: {wasm: WebAssembly.Module, worker: () => Worker, workers: number}}>}
 */
export function load(program) {
  loading ??= start(program).catch((error) => {
    loading = undefined;
    throw error;
  });
  return loading;
}

async function start(program) {
  const [glue, wasm] = await Promise.all([import('../../wasm/viewer.js'), program.compile()]);
  await glue.default({ module_or_path: wasm });
  return { Viewer: glue.Viewer, env: { wasm, worker: program.worker, workers: program.workers } };
}
