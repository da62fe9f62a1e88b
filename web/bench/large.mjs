// A large scene within a budget of graphics memory.
//
//   LEXISPLAT_NPM=node_modules node web/bench/large.mjs SCENE.lexi [--memory 2147483648] [--width 320]
//
// It loads the scene in headless Chromium, uploads what fits in this memory and draws one frame.

import { basename, dirname, resolve } from 'node:path';
import { fileURLToPath } from 'node:url';
import { parseArgs } from 'node:util';
import { launch, serve } from '../test/support/chromium.mjs';
import { openHarness } from './harness-page.mjs';

const web = dirname(dirname(fileURLToPath(import.meta.url)));
const { values, positionals } = parseArgs({
  allowPositionals: true,
  options: { memory: { type: 'string', default: String(2 ** 31) }, width: { type: 'string', default: '320' } },
});
const [scene] = positionals;
const server = await serve({ '/': web, '/scene': dirname(resolve(scene)) });
// Software takes longer for a frame of this size than Chromium waits for a GPU.
const browser = await launch(['--disable-gpu-watchdog']);
const page = await openHarness(browser, server, { timeout: 0 });
const mebibytes = (bytes) => `${(bytes / 2 ** 20).toFixed(0)} MiB`;
const { info, milliseconds, report } = await page.evaluate(([url, memory]) => window.bench.load(url, 0, memory).then(({ info, milliseconds, report }) => ({ info, milliseconds, report })), [`/scene/${basename(scene)}`, Number(values.memory)]);
const heap = await page.evaluate(() => performance.memory?.usedJSHeapSize ?? 0);
console.log(`${basename(scene)}: ${info.bytes} bytes, ${info.gaussians} Gaussians in ${info.chunks} chunks; budget ${mebibytes(Number(values.memory))}`);
console.log(`decoded and uploaded ${report.gaussians[0]} Gaussians in ${(milliseconds / 1000).toFixed(1)} s; on the GPU ${mebibytes(report.resident_bytes)}, at most ${mebibytes(report.most_bytes)}; JavaScript's heap ${mebibytes(heap)}`);
const began = performance.now();
const width = Number(values.width);
const drawn = await page.evaluate(([w, h]) => window.bench.picture(w, h), [width, Math.round((width * 2) / 3)]);
const pixels = Buffer.from(drawn.data, 'base64');
const lit = pixels.filter((v, i) => i % 4 < 3 && v > 8).length / (3 * width * drawn.height);
console.log(`one frame of ${drawn.width} x ${drawn.height} in ${((performance.now() - began) / 1000).toFixed(1)} s: ${drawn.report.drawn[0]} Gaussians drawn, ${(100 * lit).toFixed(0)} % of the values are not black`);
console.log(`on the GPU at most ${mebibytes(drawn.report.most_bytes)}: ${drawn.report.most_bytes <= Number(values.memory) ? 'within the budget' : 'ABOVE THE BUDGET'}`);
await browser.close();
await server.close();
process.exitCode = drawn.report.most_bytes <= Number(values.memory) ? 0 : 1;
