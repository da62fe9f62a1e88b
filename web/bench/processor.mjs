// A scene on the processor, in a browser without WebGPU and without a GPU.
//
//   LEXISPLAT_NPM=node_modules node web/bench/processor.mjs SCENE... [--width N] [--height N] [--spark]
//
// Of each scene, which a page of one element shows N by N pixels large (640 x 480): the times from the start of the page to the
// first picture, to the end of the file and to a picture at rest, how long that picture took, and how long coarse ones took while
// the pointer moved. With --spark, of .lexi files, also the time of a frame of Spark, which draws by WebGL2, here in software.

import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { basename, join, resolve } from 'node:path';
import { fileURLToPath } from 'node:url';
import { parseArgs } from 'node:util';
import { open } from 'lexisplat';
import { launch, serve } from '../test/support/chromium.mjs';
import { openViewer, serveViewers } from '../test/support/viewers.mjs';
import { orbit, scaled } from '../test/support/views.mjs';

const web = fileURLToPath(new URL('..', import.meta.url));
const { values, positionals } = parseArgs({
  allowPositionals: true,
  options: {
    width: { type: 'string', default: '640' },
    height: { type: 'string', default: '480' },
    spark: { type: 'boolean', default: false },
  },
});
const [width, height] = [Number(values.width), Number(values.height)];
/** Times that a page is opened; medians are printed. */
const ROUNDS = 5;
/** Steps of the pointer, and milliseconds between two. */
const [STEPS, PAUSE] = [60, 16];
/** Frames of Spark. */
const FRAMES = 9;

const folder = mkdtempSync(join(tmpdir(), 'lexisplat-processor-'));
const server = await serve({ '/': web, '/made': folder, ...Object.fromEntries(positionals.map((scene, k) => [`/scene${k}/${basename(scene)}`, resolve(scene)])) });
const browser = await launch([], { gpu: false });
const median = (numbers) => numbers.toSorted((a, b) => a - b)[numbers.length >> 1];

/** Times of a page, in milliseconds since it began. */
async function times(address) {
  writeFileSync(
    join(folder, 'host.html'),
    `<!doctype html><link rel="icon" href="data:,"><script type="module" src="/src/viewer/element.js"></script>
    <body style="margin: 0"><lexi-viewer src="${address}" style="height: 100vh" still></lexi-viewer>
    <script>
      const viewer = document.querySelector('lexi-viewer');
      viewer.addEventListener('load', () => (globalThis.loaded = performance.now()));
      globalThis.reports = new Set();
      const watch = () => {
        const { report } = viewer;
        if (report?.drawn?.[0] > 0) globalThis.first ??= performance.now();
        if (report?.milliseconds) globalThis.reports.add(report.milliseconds);
        if (globalThis.loaded && viewer.shadowRoot.querySelector('canvas').ariaBusy === 'false') globalThis.rest ??= performance.now();
        requestAnimationFrame(watch);
      };
      watch();
    </script>`,
  );
  const page = await browser.newPage({ viewport: { width, height } });
  await page.goto(`${server.url}/made/host.html`);
  await page.waitForFunction(() => globalThis.rest, undefined, { timeout: 300_000 });
  const { first, loaded, rest, report } = await page.evaluate(() => ({ first, loaded, rest, report: viewer.report }));
  if (report.renderer !== 'processor') throw new Error(`drawn by ${report.renderer}`);
  await page.evaluate(() => globalThis.reports.clear());
  await page.mouse.move(width / 2, height / 2);
  await page.mouse.down();
  const began = performance.now();
  for (let step = 0; step < STEPS; step++) {
    await page.mouse.move(width / 2 + 2 * step, height / 2 + (step % 7));
    await page.waitForTimeout(PAUSE);
  }
  const seconds = (performance.now() - began) / 1000;
  const coarse = await page.evaluate(() => [...globalThis.reports]);
  await page.close();
  return { first, loaded, rest, full: report.milliseconds, coarse: median(coarse), rate: coarse.length / seconds, gaussians: report.gaussians[0], drawn: report.drawn[0], memory: report.resident_bytes };
}

for (const [k, scene] of positionals.entries()) {
  const rounds = [];
  while (rounds.length < ROUNDS) rounds.push(await times(`/scene${k}/${basename(scene)}`));
  const of = (name) => median(rounds.map((round) => round[name]));
  const { gaussians, drawn, memory } = rounds[0];
  console.log(`${basename(scene)}: ${gaussians} Gaussians, ${drawn} in the picture, ${width} x ${height}`);
  console.log(`  since the page began: first picture ${(of('first') / 1000).toFixed(2)} s, end of the file ${(of('loaded') / 1000).toFixed(2)} s, at rest ${(of('rest') / 1000).toFixed(2)} s`);
  console.log(`  a picture in full ${of('full').toFixed(0)} ms, a coarse one ${of('coarse').toFixed(0)} ms, ${of('rate').toFixed(1)} a second while the pointer moves`);
  console.log(`  memory of the worker ${(memory / 2 ** 20).toFixed(0)} MiB`);
}
await browser.close();
await server.close();
rmSync(folder, { recursive: true });

if (values.spark) {
  const viewers = await serveViewers(Object.fromEntries(positionals.map((scene, k) => [`/scene${k}.lexi`, resolve(scene)])));
  const browser = await launch([], { gpu: false });
  const viewer = await openViewer(browser, `${viewers.url}/test/support/spark.html`);
  for (const [k, scene] of positionals.entries()) {
    const opened = await open(readFileSync(scene), { workers: 0, shParts: 0 });
    const [view] = orbit((await opened.all({ as: 'dense' })).positions, 1, height);
    opened.close();
    await viewer.call('show', { url: `/scene${k}.lexi` });
    for (const share of [1, 0.25]) {
      const size = [width, height].map((side) => Math.round(share * side));
      await viewer.call('draw', { ...scaled(view, size[1]), width: size[0] });
      const times = await viewer.call('frames', FRAMES);
      console.log(`${basename(scene)}: Spark, WebGL2, ${size.join(' x ')}: ${median(times).toFixed(0)} ms a frame (${times[0].toFixed(0)} to ${times.at(-1).toFixed(0)})`);
    }
  }
  await browser.close();
  await viewers.close();
}
