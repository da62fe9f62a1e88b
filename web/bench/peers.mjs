// Parts of other packages for decoders.mjs: Spark with a call to its decoder alone, and versions.

import { existsSync, readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { npm } from '../test/support/chromium.mjs';

/** The packages that are measured, and those that they need. */
const PACKAGES = ['playcanvas', '@adobe/spz', '@spz-loader/core', '@sparkjsdev/spark', 'three'];

// Spark's public calls decode in a worker of its own. This does what that worker does, in the module's own scope.
const ALONE = `
export const alone = {
  ready: initialization,
  packed(bytes, type) {
    const at = passStringToWasm0(type, wasm.__wbindgen_malloc, wasm.__wbindgen_realloc);
    const made = wasm.decode_to_packedsplats(at, WASM_VECTOR_LEN, 0, 0, undefined, 0, 0, 0);
    if (made[2]) throw takeFromExternrefTable0(made[1]);
    const decoder = ChunkDecoder.__wrap(made[0]);
    decoder.push(bytes);
    return decoder.finish();
  },
};
`;

/**
 * Writes spark.js to a folder: Spark's module with one more export.
 * @param {string} folder
 */
export function makeSpark(folder) {
  const path = join(npm, '@sparkjsdev/spark/dist/spark.module.js');
  // Without the package its decoders answer that they cannot be had.
  if (existsSync(path)) writeFileSync(join(folder, 'spark.js'), readFileSync(path, 'utf8') + ALONE);
}

/** Names and versions of the packages that are there. */
export function versions() {
  const version = (name) => {
    const path = join(npm, name, 'package.json');
    return existsSync(path) ? JSON.parse(readFileSync(path, 'utf8')).version : 'not there';
  };
  return PACKAGES.map((name) => `${name} ${version(name)}`);
}
