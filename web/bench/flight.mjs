// A flight through a large scene within a budget, in headless Chromium.
//
//   LEXISPLAT_NPM=node_modules node web/bench/flight.mjs SCENE.lexi CAMERAS.json [--budget 1000000] [--bytes 134217728]
//       [--width 640] [--height 360] [--whole FOLDER] [--every 10] [--rate BYTES] [--blob]
//
// It goes from camera to camera, and waits at each until all that was chosen is on the GPU. It prints what was drawn, fetched
// and held, and the memory of Chromium's processes. With FOLDER, which has pictures of all Gaussians by `render` from the same
// cameras, each tenth view is drawn and compared. RATE is how many bytes the server sends a second. With --blob
// the scene is a file in the browser: what drives it keeps up to 200 MB of a server's answers in the page's process.

import { readFileSync, readdirSync } from 'node:fs';
import { basename, dirname, join, resolve } from 'node:path';
import { fileURLToPath } from 'node:url';
import { parseArgs } from 'node:util';
import { launch, psnr, serve } from '../test/support/chromium.mjs';
import { decodePng } from '../test/support/png.mjs';
import { openHarness } from './harness-page.mjs';

const web = dirname(dirname(fileURLToPath(import.meta.url)));
const text = (value) => ({ type: 'string', default: value });
const { values, positionals } = parseArgs({
  allowPositionals: true,
  options: { budget: text('1000000'), bytes: text(String(128 * 2 ** 20)), width: text('640'), height: text('360'), whole: { type: 'string' }, every: text('10'), rate: { type: 'string' }, blob: { type: 'boolean', default: false } },
});
const [scene, cameras] = positionals.map((path) => resolve(path));
const [budget, bytes, width, height, every] = ['budget', 'bytes', 'width', 'height', 'every'].map((name) => Number(values[name]));
const names = JSON.parse(readFileSync(cameras, 'utf8')).map((camera) => camera.img_name);

const server = await serve({ '/': web, '/scene': dirname(scene), '/cameras': dirname(cameras) }, { rate: values.rate && Number(values.rate) });
const browser = await launch(['--disable-gpu-watchdog']);
const page = await openHarness(browser, server, { timeout: 0 });
await page.evaluate(([w, h]) => window.bench.resize(w, h), [width, height]);
const began = performance.now();
await page.evaluate(([url, budget, blob]) => window.bench.begin(url, budget, blob), [`/scene/${basename(scene)}`, { splats: budget, bytes }, values.blob]);
console.log(`${basename(scene)}: first layer after ${Math.round(performance.now() - began)} ms, ${fetched()} bytes`);
await page.evaluate((url) => window.bench.cameras(url), `/cameras/${basename(cameras)}`);

const views = [];
for (let k = 0; k < names.length; k++) {
  const before = fetched();
  const view = await page.evaluate(() => window.bench.fly());
  Object.assign(view, { fetched: fetched() - before, memory: memoryOf() });
  if (values.whole && k % every === 0) {
    const { data, report } = await page.evaluate(([w, h]) => window.bench.picture(w, h), [width, height]);
    const picture = { width, height, data: Buffer.from(data, 'base64') };
    const file = readdirSync(values.whole).find((file) => file.endsWith(`_${view.camera}.png`));
    view.psnr = psnr(picture, decodePng(readFileSync(join(values.whole, file))));
    view.most = report.most_bytes;
  }
  views.push(view);
}
await browser.close();
await server.close();

const of = (name) => views.map((view) => view[name]).filter((value) => value !== undefined);
const most = (values) => Math.max(...values);
const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;
const mebibytes = (bytes) => `${Math.round(bytes / 2 ** 20)} MiB`;
const whole = (value) => Math.round(value).toLocaleString('en');
console.log(`${views.length} views, at most ${whole(most(of('gaussians')))} Gaussians of ${whole(budget)}`);
console.log(`fetched for a view ${whole(mean(of('fetched')))} bytes, at most ${whole(most(of('fetched')))}; held at most ${whole(most(of('held')))}`);
console.log(`until all of a view is there: ${whole(mean(of('milliseconds')))} ms, at most ${whole(most(of('milliseconds')))}`);
console.log(`on the GPU at most ${mebibytes(most(of('resident')))}${of('most').length ? `, with buffers for drawing ${mebibytes(most(of('most')))}` : ''}`);
console.log(`WebAssembly of the page at most ${mebibytes(most(of('wasm')))}, JavaScript's heap ${mebibytes(most(of('js')))}`);
for (const kind of ['renderer', 'gpu-process']) console.log(`memory of the process '${kind}': at most ${mebibytes(most(views.map((view) => view.memory[kind] ?? 0)))}`);
const scores = of('psnr');
if (scores.length) console.log(`PSNR of ${scores.length} views: mean ${mean(scores).toFixed(2)} dB, least ${Math.min(...scores).toFixed(2)}`);

/** Bytes of ranges that were asked for. */
function fetched() {
  const ranges = server.requests.filter(({ path, range }) => path.startsWith('/scene/') && range);
  return ranges.map(({ range }) => range.match(/(\d+)-(\d+)/)).reduce((sum, [, from, to]) => sum + Number(to) + 1 - Number(from), 0);
}

/** Resident bytes of Chromium's processes by their type. */
function memoryOf() {
  const memory = {};
  for (const id of readdirSync('/proc').filter((name) => /^\d+$/.test(name))) {
    try {
      const type = /--type=([\w-]+)/.exec(readFileSync(`/proc/${id}/cmdline`, 'utf8'))?.[1];
      const resident = Number(/^VmRSS:\s+(\d+)/m.exec(readFileSync(`/proc/${id}/status`, 'utf8'))?.[1] ?? 0);
      if (type) memory[type] = Math.max(memory[type] ?? 0, 1024 * resident);
    } catch {
      // It has ended.
    }
  }
  return memory;
}
