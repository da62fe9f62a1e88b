// Makes the viewer's page of one file: HTML, style, program, workers and WebAssembly, for any server and from disk.
//
//   node build-page.mjs [--out FILE]        writes FILE, or ../crates/lexisplat-cli/assets/viewer.html.gz; gzipped if it ends so
//
// It needs esbuild, from the folder of node_modules that LEXISPLAT_NPM names or from the one beside this file. The words that are
// replaced in the written file to give it a scene is said at the head of src/viewer/page.html.

import { createHash } from 'node:crypto';
import { mkdir, readFile, writeFile } from 'node:fs/promises';
import { createRequire } from 'node:module';
import { dirname, join, resolve } from 'node:path';
import { fileURLToPath } from 'node:url';
import { parseArgs } from 'node:util';
import { gzipSync } from 'node:zlib';

const here = (path) => fileURLToPath(new URL(path, import.meta.url));
const OUT = here('../crates/lexisplat-cli/assets/viewer.html.gz');
// JavaScript that all browsers with WebGPU understand, and all with vectors in WebAssembly that are not old.
const TARGET = 'es2022';
// Each is in the page once, so that a scene can be put in by replacing text.
const MARKERS = [
  '<title>lexisplat</title>',
  'data-poster=""',
  'data-words=""',
  'data-controls="all"',
  'connect-src * blob: data:',
  'id="scene" data-name=""></script>',
  'id="scene2" data-name=""></script>',
];

/**
 * Makes the page.
 * @param {object} [options]
 * @param {string} [options.wasm] file of the compiled viewer
 * @param {string} [options.worker] script of the workers that decode
 * @param {string} [options.processor] file of the compiled renderer for browsers without WebGPU
 * @param {string} [options.processorWorker] script of the worker that draws there
 * @param {Record<string, string>} [options.instead] files to take instead of others, for tests
 * @returns {Promise<string>} the HTML
 */
export async function buildPage({
  wasm = here('wasm/viewer_bg.wasm'),
  worker = here('src/viewer-worker.js'),
  processor = here('wasm/processor_bg.wasm'),
  processorWorker = here('src/processor-worker.js'),
  instead = {},
} = {}) {
  const packed = async (file) => gzipSync(await readFile(file), { level: 9 }).toString('base64');
  const [page, program, renderer, main, decoder, drawer] = await Promise.all([
    readFile(here('src/viewer/page.html'), 'utf8'),
    packed(wasm),
    packed(processor),
    bundle(here('src/viewer/single.js'), instead),
    bundle(worker, instead),
    bundle(processorWorker, instead),
  ]);
  const hash = createHash('sha256').update(main).digest('base64');
  const policy = `default-src 'none'; script-src 'sha256-${hash}' 'wasm-unsafe-eval'; worker-src blob:; connect-src * blob: data:; img-src blob: data:; base-uri 'none'; form-action 'none'`;
  const inline = [
    `<script type="application/gzip" id="program">${program}</script>`,
    `<script type="application/gzip" id="processor">${renderer}</script>`,
    `<script type="text/plain" id="worker">${decoder}</script>`,
    `<script type="text/plain" id="processor-worker">${drawer}</script>`,
    `<script>${main}</script>`,
  ].join('\n');

  let html = replaced(page, /<!--[^]*?-->\n/, '');
  html = replaced(html, /(?<=http-equiv="Content-Security-Policy" content=")[^"]*/, policy);
  html = replaced(html, /<script type="module"[^>]*><\/script>\n/, '');
  html = replaced(html, /(?=<\/body>)/, `${inline}\n`);
  for (const marker of MARKERS) {
    if (html.split(marker).length !== 2) throw new Error(`${marker} is not in the page once`);
  }
  return html;
}

async function bundle(entry, instead) {
  const swap = {
    name: 'instead',
    setup: (build) => {
      build.onResolve({ filter: /^\./ }, ({ path, resolveDir }) => {
        const other = instead[resolve(resolveDir, path)];
        return other && { path: other };
      });
    },
  };
  const { outputFiles } = await esbuild().build({
    entryPoints: [entry],
    bundle: true,
    format: 'iife',
    target: TARGET,
    minify: true,
    legalComments: 'none',
    // The files beside a module are inlined here, and only their default addresses name them.
    define: { 'import.meta.url': '"about:blank"' },
    // Node's own modules are asked for in Node only.
    external: ['node:*'],
    write: false,
    logLevel: 'warning',
    plugins: [swap],
  });
  const text = outputFiles[0].text.trim();
  // HTML ends a script at the first of these, whatever the program means by it.
  if (/<\/script|<!--/i.test(text)) throw new Error(`${entry}: the program has </script or <!-- in it`);
  return text;
}

function esbuild() {
  const folders = [process.env.LEXISPLAT_NPM, here('node_modules')].filter(Boolean);
  for (const folder of folders) {
    try {
      return createRequire(join(resolve(folder), 'x.js'))('esbuild');
    } catch (error) {
      if (error.code !== 'MODULE_NOT_FOUND') throw error;
    }
  }
  throw new Error('esbuild is missing: npm install esbuild, and name its node_modules by LEXISPLAT_NPM');
}

// A function, since `$` has a meaning in a text that replaces.
function replaced(text, pattern, by) {
  if (!pattern.test(text)) throw new Error(`src/viewer/page.html has nothing like ${pattern}`);
  return text.replace(pattern, () => by);
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  const { values } = parseArgs({ options: { out: { type: 'string', default: OUT } } });
  const html = await buildPage();
  await mkdir(dirname(values.out), { recursive: true });
  const bytes = values.out.endsWith('.gz') ? gzipSync(html, { level: 9 }) : Buffer.from(html);
  await writeFile(values.out, bytes);
  console.log(`${values.out}: ${bytes.length} bytes`);
}
