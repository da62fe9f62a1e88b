/**
 * A plugin of esbuild. It puts the WebAssembly and the workers of the package beside the bundle, which esbuild does not do
 * for `new URL('...', import.meta.url)` by itself, as other bundlers do.
 *
 *     import lexisplat from 'lexisplat/esbuild';
 *     await esbuild.build({ entryPoints: ['app.js'], bundle: true, format: 'esm', outdir: 'dist', plugins: [lexisplat()] });
 */

import { readFile } from 'node:fs/promises';
import { dirname, extname, resolve } from 'node:path';
import { fileURLToPath } from 'node:url';

/** The folder of the package's modules. */
const SOURCES = fileURLToPath(new URL('./src/', import.meta.url));
/** An address of a file beside a module. */
const ADDRESS = /new URL\('(\.[^']+)', import\.meta\.url\)/g;
/** The name of such a file in the bundle. */
const PART = 'lexisplat-part';

/** @returns {import('esbuild').Plugin} */
export default function lexisplat() {
  return { name: 'lexisplat', setup };
}

function setup(build) {
  const { format, minify, target, legalComments } = build.initialOptions;
  build.onStart(() => {
    // Other formats have no import.meta.url.
    if (format !== 'esm') return { errors: [{ text: "lexisplat: the format has to be 'esm'" }] };
  });
  build.onLoad({ filter: /\.js$/ }, async ({ path, namespace }) => {
    if (namespace !== 'file' || !path.startsWith(SOURCES)) return undefined;
    const imports = [];
    const text = (await readFile(path, 'utf8')).replace(ADDRESS, (_, to) => {
      const name = `part${imports.length}`;
      imports.push(`import ${name} from ${JSON.stringify(`${PART}:${resolve(dirname(path), to)}`)};\n`);
      return `new URL(${name}, import.meta.url)`;
    });
    return { contents: imports.join('') + text, loader: 'js', resolveDir: dirname(path) };
  });
  build.onResolve({ filter: new RegExp(`^${PART}:`) }, ({ path }) => ({ path: path.slice(PART.length + 1), namespace: PART }));
  build.onLoad({ filter: /.*/, namespace: PART }, async ({ path }) => {
    if (extname(path) !== '.js') return { contents: await readFile(path), loader: 'file' };
    const options = { entryPoints: [path], bundle: true, format, minify, target, legalComments, write: false };
    const { outputFiles } = await build.esbuild.build(options);
    return { contents: outputFiles[0].contents, loader: 'file' };
  });
}
