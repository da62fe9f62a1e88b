// The page, the element and the page of one file with the real WebAssembly, drawn by WebGPU in Chromium.

import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { existsSync } from 'node:fs';
import { mkdtemp, readFile, rm, writeFile } from 'node:fs/promises';
import { createServer } from 'node:http';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, describe } from 'node:test';
import { fileURLToPath, pathToFileURL } from 'node:url';
import { buildPage } from '../build-page.mjs';
import { launch, npm, psnr, serve, shot } from './support/chromium.mjs';
import { faultless, newPage, web, whole } from './support/viewer-page.mjs';

const wasm = join(web, 'wasm/viewer_bg.wasm');
const golden = fileURLToPath(new URL('../../crates/lexisplat/tests/golden', import.meta.url));
// 2,600 Gaussians in layers, and 300 as a file of two formats.
const SCENE = 'packed3_layers.lexi';
const [PACKED, PLAIN] = ['packed3.lexi', 'packed3.ply'];
// WebGPU in software is slow, and processors may be busy: milliseconds.
const PATIENCE = 120_000;
const SIZE = { width: 360, height: 240 };
// Two pictures of one view are at least as alike, in dB.
const SAME = 45;
// The least share of pixels that a scene lights.
const LIT = 0.1;

const program = process.env.LEXISPLAT_PROGRAM;
const missing = !npm ? 'LEXISPLAT_NPM is not set' : ![wasm, golden].every(existsSync) && 'the viewer or the golden files are missing';

describe('the viewer with WebGPU', { skip: missing }, () => {
  let browser;
  let server;
  let folder;
  let page;
  before(async () => {
    folder = await mkdtemp(join(tmpdir(), 'lexisplat-viewer-'));
    await writeFile(join(folder, 'wrong.ply'), 'ply\nthis is no PLY\n');
    [browser, server] = await Promise.all([launch(), serve({ '/': web, '/golden': golden, '/made': folder })]);
  });
  after(async () => {
    await Promise.all([browser?.close(), server?.close()]);
    await rm(folder, { recursive: true });
  });

  const open = async (address, options = {}) => {
    page = await newPage(browser, { viewport: SIZE, ...options });
    page.setDefaultTimeout(PATIENCE);
    await page.goto(address);
  };
  const pageOf = (query) => `${server.url}/src/viewer/page.html${query}`;
  const drop = (files) =>
    page.evaluate(async (files) => {
      const dataTransfer = new DataTransfer();
      for (const address of files) dataTransfer.items.add(new File([await (await fetch(address)).arrayBuffer()], address.split('/').pop()));
      document.body.dispatchEvent(new DragEvent('drop', { dataTransfer, bubbles: true, cancelable: true }));
    }, files);
  const message = (text) => page.locator('.message', { hasText: text }).waitFor();
  const lit = ({ data }) => data.filter((value, at) => at % 4 === 1 && value > 24).length / (data.length / 4);
  // Returns the picture when nothing changes any more.
  const rested = async () => {
    for (let last; ; ) {
      await page.waitForTimeout(500);
      const next = await shot(page, 'canvas');
      // On a busy machine a finer picture may be more than the time between two shots away.
      const busy = await page.locator('canvas').getAttribute('aria-busy');
      if (last && busy !== 'true' && lit(next) > LIT && psnr(last, next) === Infinity) return next;
      last = next;
    }
  };
  const test = faultless(() => page, { timeout: PATIENCE });

  test('the page draws files of two formats, compares them, and goes on after a wrong one', async () => {
    await open(pageOf(''));
    await drop([`/golden/${PACKED}`, `/golden/${PLAIN}`]);
    await page.locator('.overlay').getByText(PLAIN).waitFor();
    await page.keyboard.press('h');
    await Promise.all([whole(page, PACKED), whole(page, PLAIN)]);
    await page.locator('.psnr', { hasText: /identical|dB/ }).waitFor();
    const text = await page.locator('.psnr').textContent();
    assert.ok(text === 'identical' || parseFloat(text) > SAME, `the PLY is what the other file says: ${text}`);
    await drop(['/made/wrong.ply']);
    await message('wrong.ply');
    await page.keyboard.press('1');
    await page.getByRole('button', { name: `Remove ${PLAIN}` }).click();
    await page.keyboard.press('h');
    assert.ok(lit(await rested()) > LIT);
  });

  test('a link shows the very view again', async () => {
    await open(pageOf(`?url=/golden/${SCENE}`), { permissions: ['clipboard-read', 'clipboard-write'] });
    await page.waitForFunction((name) => document.title === name, SCENE);
    const before = await rested();
    for (const key of ['ArrowRight', 'ArrowRight', 'ArrowRight', 'ArrowUp']) await page.keyboard.press(key);
    await page.getByRole('button', { name: 'Copy a link' }).click();
    await message('The link was copied');
    await page.getByRole('button', { name: 'Close' }).click();
    const link = page.url();
    const view = await rested();
    assert.ok(psnr(before, view) < SAME, 'the view has moved');
    await page.goto('about:blank');
    await page.goto(link);
    await page.waitForFunction((name) => document.title === name, SCENE);
    const again = await rested();
    assert.ok(psnr(view, again) > SAME, `${psnr(view, again)} dB`);
  });

  test('the page begins with the view that the file states', async () => {
    execFileSync(program, ['convert', join(golden, SCENE), join(folder, 'seen.lexi'), '--view', '0:0:-9:0:0:0:1:9:1.25', '--quiet']);
    await open(pageOf('?url=/made/seen.lexi'), { permissions: ['clipboard-read', 'clipboard-write'] });
    await page.waitForFunction((name) => document.title === name, 'seen.lexi');
    await page.getByRole('button', { name: 'Copy a link' }).click();
    await message('The link was copied');
    assert.match(decodeURIComponent(page.url()), /#view=0:0:-9:0:0:0:1:9:1.25&/);
  }, { skip: !program && 'LEXISPLAT_PROGRAM is not set' });

  test('a cut connection leaves what had come', async () => {
    const bytes = await readFile(join(golden, SCENE));
    const cutter = createServer((_, response) => {
      response.writeHead(200, { 'content-length': bytes.length, 'access-control-allow-origin': '*' });
      response.write(bytes.subarray(0, bytes.length / 2), () => setTimeout(() => response.destroy(), 2000));
    });
    await new Promise((done) => cutter.listen(0, '127.0.0.1', done));
    try {
      await open(pageOf(`?url=${encodeURIComponent(`http://localhost:${cutter.address().port}/cut.lexi`)}`));
      await message('cut.lexi: ');
      await page.getByRole('button', { name: 'Close' }).click();
      assert.ok(lit(await rested()) > LIT);
    } finally {
      cutter.closeAllConnections();
      cutter.close();
    }
  });

  test('the element draws, and goes on on the processor when the GPU is lost for good', async () => {
    await writeFile(join(folder, 'host.html'), `<!doctype html><title>host</title><script type="module" src="/src/viewer/element.js"></script><lexi-viewer src="/golden/${SCENE}" controls="none"></lexi-viewer>`);
    page = await newPage(browser, { viewport: SIZE });
    page.setDefaultTimeout(PATIENCE);
    await page.addInitScript(() => {
      const request = GPUAdapter.prototype.requestDevice;
      GPUAdapter.prototype.requestDevice = async function (...options) {
        return (globalThis.device = await request.apply(this, options));
      };
    });
    await page.goto(`${server.url}/made/host.html`);
    await page.locator('.app.shown').waitFor();
    const before = await rested();
    assert.ok(lit(before) > LIT);
    const { drawn, models, renderer } = await page.evaluate(() => document.querySelector('lexi-viewer').report);
    assert.ok(drawn[0] > 0 && models[0].gaussians === 2600 && renderer === 'webgpu', JSON.stringify({ drawn, models, renderer }));
    await page.evaluate(() => {
      GPU.prototype.requestAdapter = async () => null;
      globalThis.device.destroy();
    });
    await page.waitForFunction(() => document.querySelector('lexi-viewer').report.renderer === 'processor');
    await page.locator('.app.shown').waitFor();
    await page.locator('canvas[aria-busy=false]').waitFor();
    const after = await shot(page, 'canvas.picture');
    assert.ok(psnr(before, after) > SAME, `${psnr(before, after)} dB`);
  });

  test('the element draws within a budget, and as much as another one allows', async () => {
    const body = `<lexi-viewer src="/golden/${SCENE}" budget="1500" still></lexi-viewer>`;
    await writeFile(join(folder, 'host.html'), `<!doctype html><title>host</title><script type="module" src="/src/viewer/element.js"></script>${body}`);
    await open(`${server.url}/made/host.html`);
    const complete = (least) => page.waitForFunction((least) => {
      const state = document.querySelector('lexi-viewer').report?.streams[0];
      return state?.complete && state.drawn >= least && state;
    }, least);
    const few = await (await complete(1)).jsonValue();
    assert.ok(few.drawn === few.splats && few.splats <= 1500, JSON.stringify(few));
    const coarse = await rested();
    await page.evaluate(() => (document.querySelector('lexi-viewer').budget = '5000'));
    const more = await (await complete(few.drawn + 1)).jsonValue();
    assert.equal(more.drawn, 2600);
    const fine = await rested();
    await page.evaluate(() => (document.querySelector('lexi-viewer').budget = '1500'));
    await page.waitForFunction(() => document.querySelector('lexi-viewer').report.streams[0].drawn <= 1500);
    const again = await rested();
    assert.ok(psnr(coarse, again) > Math.max(SAME, psnr(coarse, fine)), `${psnr(coarse, fine)} and ${psnr(coarse, again)} dB`);
    const ranges = server.requests.filter(({ path, range }) => path.endsWith(SCENE) && range);
    assert.ok(ranges.length > 2, 'it is fetched by ranges');
  });

  test('the page of one file draws from disk', async () => {
    const scene = (await readFile(join(golden, SCENE))).toString('base64');
    const html = (await buildPage()).replace('id="scene" data-name=""></script>', `id="scene" data-name="${SCENE}">${scene}</script>`);
    await writeFile(join(folder, 'scene.html'), html);
    await open(pathToFileURL(join(folder, 'scene.html')).href);
    await page.waitForFunction((name) => document.title === name, SCENE);
    assert.ok(lit(await rested()) > LIT);
  });
});
