// How a scene shows while it comes over a slow link.
//
//   LEXISPLAT_NPM=node_modules node web/bench/stream.mjs PROGRAM SCENE.ply SCENE.lexi CAMERAS.json [--share 15] [--rate 1250000]
//
// It loads SCENE.lexi in headless Chromium twice: over a link held to the rate (bytes a second; 1,250,000 are 10 Mbit/s),
// and from a server that stops after a share of the bytes (percent). It prints when what was there, and the PSNR of 3 test
// views of the stopped scene against the processor's pictures of SCENE.ply.

import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } from 'node:fs';
import { createServer } from 'node:http';
import { tmpdir } from 'node:os';
import { basename, dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { parseArgs } from 'node:util';
import { launch, psnr, serve } from '../test/support/chromium.mjs';
import { decodePng } from '../test/support/png.mjs';
import { openHarness } from './harness-page.mjs';

/** Test views that are compared, and their width in pixels. */
const VIEWS = 3;
const WIDTH = 320;
/** Time that the decoder is given for what came, in milliseconds. */
const SETTLE = 3000;

const web = dirname(dirname(fileURLToPath(import.meta.url)));
const { values, positionals } = parseArgs({
  allowPositionals: true,
  options: { share: { type: 'string', default: '15' }, rate: { type: 'string', default: '1250000' } },
});
const [program, ply, scene, cameras] = positionals;

const scratch = mkdtempSync(join(tmpdir(), 'lexisplat-stream-'));
const browser = await launch();
try {
  const all = JSON.parse(readFileSync(cameras, 'utf8'));
  const test = all.filter((camera) => camera.split === 'test');
  const chosen = Array.from({ length: VIEWS }, (_, i) => test[Math.floor(((i + 0.5) * test.length) / VIEWS)]);
  writeFileSync(join(scratch, 'cameras.json'), JSON.stringify(chosen));
  const render = ['render', ply, '-o', join(scratch, 'views'), '--quiet', '--width', String(WIDTH), '--device', 'cpu', '--cameras', join(scratch, 'cameras.json')];
  execFileSync(program, render, { stdio: 'inherit' });
  const pictures = readdirSync(join(scratch, 'views')).sort().map((file) => decodePng(readFileSync(join(scratch, 'views', file))));

  const bytes = readFileSync(scene);
  const server = await serve({ '/': web, '/scratch': scratch });
  let page = await openHarness(browser, server);
  // The page and the scene have different origins, as on the web.
  const slow = createServer((request, response) => send(response, bytes, Number(values.rate)));
  await new Promise((done) => slow.listen(0, '127.0.0.1', done));
  const timed = await page.evaluate((url) => window.bench.load(url), `http://localhost:${slow.address().port}/${basename(scene)}`);
  const { events, info } = timed;
  const last = events.find(([, loaded]) => loaded >= info.bytes)?.[0];
  const first = events.find(([, , decoded]) => decoded > 0)?.[0];
  console.log(`${basename(scene)}: ${bytes.length} bytes, ${info.gaussians} Gaussians, ${info.layers} layers, ${values.rate} bytes a second`);
  console.log(`the first layer ends after ${((100 * info.firstLayerEnd) / bytes.length).toFixed(1)} % of the bytes`);
  console.log(`first chunk decoded after ${first.toFixed(0)} ms, last byte after ${last.toFixed(0)} ms, all decoded ${(timed.milliseconds - last).toFixed(0)} ms later`);
  slow.closeAllConnections();
  slow.close();
  await page.close();

  page = await openHarness(browser, server);
  const part = bytes.subarray(0, Math.floor((bytes.length * Number(values.share)) / 100));
  const stopped = createServer((request, response) => {
    response.writeHead(200, { 'content-length': bytes.length, 'access-control-allow-origin': '*' });
    response.write(part);
  });
  await new Promise((done) => stopped.listen(0, '127.0.0.1', done));
  await page.evaluate((url) => void (window.pending = window.bench.load(url).catch((error) => error.message)), `http://localhost:${stopped.address().port}/${basename(scene)}`);
  await page.waitForTimeout(SETTLE);
  await page.evaluate((url) => window.bench.cameras(url), '/scratch/cameras.json');
  const found = [];
  for (const [i, expected] of pictures.entries()) {
    const drawn = await page.evaluate(([w, h, words]) => window.bench.picture(w, h, words), [expected.width, expected.height, `camera=${i}`]);
    found.push(psnr(expected, { ...drawn, data: Buffer.from(drawn.data, 'base64') }));
  }
  const mean = found.reduce((a, b) => a + b) / found.length;
  console.log(`with ${values.share} % of the bytes: ${mean.toFixed(2)} dB on average over ${VIEWS} test views (${found.map((db) => db.toFixed(1)).join(', ')})`);
  stopped.closeAllConnections();
  stopped.close();
  console.log(`then the connection is cut: ${await page.evaluate(() => window.pending)}`);
  await server.close();
} finally {
  await browser.close();
  rmSync(scratch, { recursive: true });
}

/** Sends bytes at a rate. */
async function send(response, bytes, rate) {
  const PIECE = 16 << 10;
  response.writeHead(200, { 'content-length': bytes.length, 'access-control-allow-origin': '*' });
  let free = performance.now();
  for (let at = 0; at < bytes.length && !response.destroyed; at += PIECE) {
    free += (1000 * PIECE) / rate;
    await new Promise((done) => setTimeout(done, Math.max(0, free - performance.now())));
    response.write(bytes.subarray(at, at + PIECE));
  }
  response.end();
}
