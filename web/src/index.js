/** Opens .lexi files: `open(url)` gives the header at once and the chunks as they are decoded. */

import { environment } from './env.js';
import { openWith } from './open.js';

export { Scene } from './scene.js';

/**
 * Opens the .lexi file at an address, in a Blob or in memory; in Node also at a path.
 *
 * @param {string | URL | Blob | ArrayBuffer | ArrayBufferView} source
 * @param {import('./index.d.ts').OpenOptions} [options]
 * @returns {Promise<import('./index.d.ts').Scene>}
 */
export async function open(source, options = {}) {
  return openWith(await environment(), source, options);
}
