/** How Node loads the parts of the package, and reads files. */

import { readFile } from 'node:fs/promises';
import { Worker } from 'node:worker_threads';
import { fileOf } from './file.js';

/** @type {import('../env.js').Platform} */
export const platform = {
  compile: async (url) => WebAssembly.compile(await readFile(url)),
  worker: () => new Worker(new URL('./worker.js', import.meta.url)),
  filesWorker: () => new Worker(new URL('./files-worker.js', import.meta.url)),
  hasWorkers: true,
  source: fileOf,
};
