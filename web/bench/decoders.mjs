// One table of files and decoders: bytes, PSNR, decode rate, bytes on the GPU; ours, SPZ, SOG and compressed.ply of a scene.
//
//   LEXISPLAT_NPM=node_modules node web/bench/decoders.mjs PROGRAM SCENE.ply [CAMERAS.json | -] [--lexi FILE]
//       [--match | --matched FILE] [--views N] [--rounds N] [--json]
//
// PROGRAM is a built `lexisplat`; SCENE.ply has SH of degree 3. --lexi takes a ready file of `compress --preset balanced`.
// --match also makes a .lexi of the PSNR of the SPZ, which takes minutes, and --matched takes a ready one. PSNR is of at most
// N (13) test views, or of views around the scene. Rates are medians of N (7) rounds, in each of which every decoder decodes
// once. They go from bytes in memory to arrays of positions, scales, rotations, opacities, colours and SH, or to what the
// viewer itself draws from, as the table says. Bytes on the GPU are those of the scene, without what a viewer sorts and draws
// with.
//
// LEXISPLAT_NPM needs playwright-core, three, fflate, playcanvas, @sparkjsdev/spark, @adobe/spz and @spz-loader/core.
// A package that is not there is not measured, and the table says so.

import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { cpus, tmpdir } from 'node:os';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { parseArgs } from 'node:util';
import { open } from 'lexisplat';
import { launch } from '../test/support/chromium.mjs';
import { serveViewers } from '../test/support/viewers.mjs';
import { makeFiles } from './decoders-files.mjs';
import { report } from './decoders-report.mjs';
import { makeSpark, versions } from './peers.mjs';
import { openHarness } from './harness-page.mjs';

const web = dirname(dirname(fileURLToPath(import.meta.url)));

const { values, positionals } = parseArgs({
  allowPositionals: true,
  options: {
    lexi: { type: 'string' },
    match: { type: 'boolean', default: false },
    matched: { type: 'string' },
    views: { type: 'string', default: '13' },
    rounds: { type: 'string', default: '7' },
    json: { type: 'boolean', default: false },
  },
});
const [program, ply, cameras = '-'] = positionals;
if (!program || !ply) throw new Error('usage: decoders.mjs PROGRAM SCENE.ply [CAMERAS.json | -]');
const scratch = mkdtempSync(join(tmpdir(), 'lexisplat-decoders-'));

/** Every decoder that is timed: [row, column] of the table, the file, and what the page is asked for. */
function jobsOf(files) {
  const jobs = [];
  const add = (file, row, column, name, options) => jobs.push({ file, row, column, name, options });
  for (const file of Object.keys(files).filter((name) => name.startsWith('.lexi'))) {
    for (const as of ['dense', 'codes']) {
      const gives = as === 'dense' ? 'floats' : 'floats, SH as codes';
      add(file, `lexisplat, wasm alone: ${gives}`, 'one', 'alone', { as });
      add(file, `lexisplat, open: ${gives}`, 'one', 'open', { as, workers: 0 });
      add(file, `lexisplat, open: ${gives}`, 'two', 'open', { as, workers: 2 });
      add(file, `lexisplat, open, workers started before: ${gives}`, 'two', 'open', { as, workers: 2, isStarted: true });
    }
    add(file, 'lexisplat/playcanvas: resource', 'two', 'playcanvas', { ext: 'lexi' });
  }
  for (const file of ['SPZ v3', 'SPZ v4']) {
    add(file, '@adobe/spz: floats', 'one', 'adobe', {});
    add(file, '@adobe/spz, in pieces: floats', 'one', 'adobePieces', {});
    add(file, '@spz-loader/core: floats', 'one', 'loader', {});
    add(file, 'Spark, wasm alone: packed', 'one', 'sparkAlone', {});
    add(file, 'Spark, PackedSplats: packed', 'worker', 'spark', {});
  }
  add('SOG', 'PlayCanvas: resource', 'browser', 'playcanvas', { ext: 'sog' });
  add('SOG', 'PlayCanvas, decompress: floats', 'browser', 'playcanvas', { ext: 'sog', isFloats: true });
  add('compressed.ply', 'PlayCanvas: resource', 'one', 'playcanvas', { ext: 'ply' });
  add('compressed.ply', 'PlayCanvas, decompress: floats', 'one', 'playcanvas', { ext: 'ply', isFloats: true });
  return jobs.map((job) => ({ ...job, times: [] }));
}

/** Times all jobs, in turns, so that what else the machine does falls on all of them. */
async function timed(page, jobs) {
  // The first round compiles and warms up.
  for (let round = 0; round <= Number(values.rounds); round++) {
    for (let i = 0; i < jobs.length; i++) {
      const job = jobs[(i + round) % jobs.length];
      if (job.error) continue;
      const { ms, error, gpu, gaussians } = await page.evaluate(([n, f, o]) => window.bench.time(n, f, o), [job.name, job.file, job.options]);
      if (error) job.error = error;
      else if (round > 0) job.times.push(ms);
      job.gpu ??= gpu;
      job.gaussians ??= gaussians;
    }
  }
}

/** Gaussians of the source. Chunks of files of ours are added to what is known of them. */
async function sourceOf(files) {
  let source;
  for (const [name, file] of Object.entries(files)) {
    if (!name.startsWith('.lexi')) continue;
    const scene = await open(readFileSync(file.path), { workers: 0 });
    file.chunks = scene.header.chunks;
    source ??= scene.header.sourceGaussians;
    scene.close();
  }
  return source;
}

/** Bytes of scenes of ours in our viewer. */
async function ourBytesOnGpu(browser, server, files) {
  const page = await openHarness(browser, server);
  const found = {};
  for (const [i, name] of Object.keys(files).entries()) {
    if (!name.startsWith('.lexi')) continue;
    const loaded = await page.evaluate((url) => window.bench.load(url), `/file-${i}`);
    found[name] = loaded.report.scene_bytes[0];
  }
  await page.close();
  return found;
}

const browser = await launch(['--js-flags=--expose-gc']);
let server;
try {
  const files = makeFiles({ program, ply, cameras, scratch, ...values });
  makeSpark(scratch);
  const addresses = Object.fromEntries(Object.keys(files).map((name, i) => [name, `/file-${i}`]));
  server = await serveViewers({ '/made': scratch, ...Object.fromEntries(Object.entries(files).map(([name, { path }]) => [addresses[name], path])) });
  const gpu = { ours: await ourBytesOnGpu(browser, server, files) };
  const page = await browser.newPage();
  page.on('pageerror', (error) => console.error(error.message));
  await page.goto(`${server.url}/bench/decoders.html`);
  await page.waitForFunction(() => document.title === 'ready');
  await page.evaluate((list) => window.bench.prepare(list), addresses);
  const jobs = jobsOf(files);
  await timed(page, jobs);
  gpu.spark = await page.evaluate((file) => window.bench.sparkOnGpu(file), 'SPZ v3').catch((error) => ({ error: error.message }));
  const source = await sourceOf(files);
  const packages = [`lexisplat ${JSON.parse(readFileSync(join(web, 'package.json'), 'utf8')).version}`, ...versions(), `Chromium ${browser.version()}`, `Node ${process.version}`];
  const result = { scene: ply, source, files, jobs, gpu, packages, rounds: Number(values.rounds), processor: `${cpus().length} x ${cpus()[0]?.model}` };
  console.log(values.json ? JSON.stringify(result) : report(result));
} finally {
  await browser.close();
  await server?.close();
  rmSync(scratch, { recursive: true });
}
