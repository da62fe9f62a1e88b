// The viewer compiled to WebAssembly, loaded once for all elements of a page, and who draws for it.

import { reason } from './dom.js';

/**
 * Where the program's parts are.
 * @typedef {object} Program
 * @property {() => Promise<WebAssembly.Module>} compile gives the compiled viewer
 * @property {() => Worker} worker starts a worker that decodes
 * @property {number} workers how many of them; 0 decodes on the page's thread
 * @property {Processor} [processor] what draws where there is no WebGPU; without it nothing is drawn there
 */

/**
 * What draws on the processor.
 * @typedef {object} Processor
 * @property {() => Promise<WebAssembly.Module>} compile
 * @property {() => Worker} worker
 */

/** A module with a function that gives a vector of 128 bits. */
const SIMD = Uint8Array.of(
  ...[0x00, 0x61, 0x73, 0x6d, 0x01, 0x00, 0x00, 0x00], // magic number, version
  ...[0x01, 0x05, 0x01, 0x60, 0x00, 0x01, 0x7b], // a type: nothing to v128
  ...[0x03, 0x02, 0x01, 0x00], // a function of it
  ...[0x0a, 0x16, 0x01, 0x14, 0x00, 0xfd, 0x0c, ...Array(16).fill(0), 0x0b], // v128.const 0
);

let loading;

/** Says why nothing can be drawn in this browser, or nothing if it may. */
export function obstacle() {
  if (!globalThis.WebAssembly?.validate(SIMD)) return 'This browser has no WebAssembly with SIMD, which draws the scene. Current Chrome, Edge, Safari and Firefox have it.';
}

/** Says why WebGPU cannot draw in this browser, or nothing if it may. */
function withoutGpu() {
  if (!globalThis.isSecureContext) return 'Browsers offer WebGPU to pages from https:// and localhost only.';
  if (!navigator.gpu) return 'This browser has no WebGPU.';
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

/**
 * Makes a viewer that draws by WebGPU, or else on the processor. Rejects with the reasons if it can have neither.
 * @param {object} options
 * @param {Program} options.program
 * @param {HTMLCanvasElement} options.canvas
 * @param {boolean} [options.forced] whether the processor draws in any case
 * @param {() => void} [options.lost] is told that the GPU was lost, and with it all scenes
 * @returns {Promise<{viewer: any, painter?: import('./painter.js').Painter, why: string}>} why: what is wrong with WebGPU here
 */
export async function openViewer({ program, canvas, forced = false, lost }) {
  const options = JSON.stringify({});
  const paint = async () => (await import('./painter.js')).Painter.open(program.processor, canvas);
  let why = forced ? '' : withoutGpu();
  // Both programs come at the same time where both are needed.
  const early = why === undefined ? undefined : paint();
  early?.catch(() => {});
  const { Viewer } = await load(program).catch((error) => {
    early?.then((painter) => painter.close(), () => {});
    throw error;
  });
  if (!early) {
    try {
      const viewer = await Viewer.create(canvas, options);
      viewer.device()?.lost.then(lost);
      return { viewer, why: '' };
    } catch (error) {
      why = reason(error);
    }
  }
  try {
    const painter = await (early ?? paint());
    return { viewer: painter.serve(Viewer.on_processor(options)), painter, why };
  } catch (error) {
    throw new Error([why, reason(error)].filter(Boolean).join(' '), { cause: error });
  }
}
