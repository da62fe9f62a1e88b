// The viewer in a browser without WebGPU and without a GPU: a worker draws on the processor.
//
// LEXISPLAT_PROGRAM names a built `lexisplat`, whose own pictures the viewer's have to match, and LEXISPLAT_PAGE the built page.

import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { existsSync, readdirSync } from 'node:fs';
import { mkdtemp, readFile, rm, writeFile } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, describe } from 'node:test';
import { fileURLToPath, pathToFileURL } from 'node:url';
import { launch, npm, psnr, serve, shot } from './support/chromium.mjs';
import { decodePng } from './support/png.mjs';
import { faultless, newPage, web } from './support/viewer-page.mjs';

const golden = fileURLToPath(new URL('../../crates/lexisplat/tests/golden', import.meta.url));
// 2,600 Gaussians in layers, and 300 as a file of two formats.
const SCENE = 'packed3_layers.lexi';
const [PACKED, PLAIN] = ['packed3.lexi', 'packed3.ply'];
const { LEXISPLAT_PROGRAM: program, LEXISPLAT_PAGE: built } = process.env;
const PATIENCE = 60_000;
const SIZE = { width: 360, height: 240 };
// The least share of pixels that a scene lights, and least likeness of the same picture by the program and in the page, in dB.
const LIT = 0.05;
const SAME = 45;
// Likeness in dB above which two pictures show the scene from the same place.
const ALIKE = 35;

const missing = !npm ? 'LEXISPLAT_NPM is not set' : !existsSync(join(web, 'wasm/processor_bg.wasm')) && 'the WebAssembly is not built';

describe('the viewer without WebGPU', { skip: missing }, () => {
  let browser;
  let server;
  let folder;
  let page;
  before(async () => {
    folder = await mkdtemp(join(tmpdir(), 'lexisplat-processor-'));
    [browser, server] = await Promise.all([launch([], { gpu: false }), serve({ '/': web, '/golden': golden, '/made': folder })]);
  });
  after(async () => {
    await Promise.all([browser?.close(), server?.close()]);
    await rm(folder, { recursive: true });
  });

  const open = async (address, options = {}) => {
    page = await newPage(browser, { viewport: SIZE, ...options });
    page.setDefaultTimeout(PATIENCE);
    page.requests = [];
    page.on('request', (request) => page.requests.push(request.url()));
    await page.goto(address);
  };
  /** Opens a page with an element that fills it. */
  const element = async (attributes) => {
    const html = `<!doctype html><title>host</title><link rel="icon" href="data:,"><script type="module" src="/src/viewer/element.js"></script>
      <body style="margin: 0"><lexi-viewer ${attributes} style="height: 100vh"></lexi-viewer></body>`;
    await writeFile(join(folder, 'host.html'), html);
    await open(`${server.url}/made/host.html`);
  };
  const lit = ({ data }) => data.filter((value, at) => at % 4 === 1 && value > 24).length / (data.length / 4);
  /** What is shown at rest, without what lies over it. */
  const rested = async () => {
    await page.locator('.app.shown').waitFor();
    await page.locator('progress.thin').waitFor({ state: 'hidden' });
    await page.locator('canvas[aria-busy=false]').waitFor();
    await page.evaluate(() => {
      const host = document.querySelector('lexi-viewer') ?? document.getElementById('viewer');
      for (const over of host.shadowRoot.querySelectorAll('.hint, .dock, .overlay, .panel')) over.style.visibility = 'hidden';
    });
    const shown = await shot(page, '.view');
    assert.ok(lit(shown) > LIT, `${lit(shown)} of the picture is lit`);
    return shown;
  };
  const test = faultless(() => page, { timeout: PATIENCE });

  test('the page of one file shows the scene that it carries, from disk, and it turns with the pointer', async () => {
    const scene = (await readFile(join(golden, SCENE))).toString('base64');
    const place = 'id="scene" data-name=""></script>';
    const html = (await readFile(built, 'utf8')).replace(place, () => `id="scene" data-name="${SCENE}">${scene}</script>`).replace('data-controls="all"', 'data-controls="bar"');
    await writeFile(join(folder, 'scene.html'), html);
    await open(pathToFileURL(join(folder, 'scene.html')).href);
    await page.getByText('Drawn by the processor').waitFor();
    const first = await rested();
    await page.mouse.move(180, 120);
    await page.mouse.down();
    await page.mouse.move(260, 130, { steps: 5 });
    const moving = await shot(page, '.view');
    await page.mouse.up();
    const turned = await rested();
    assert.ok(lit(moving) > LIT, 'the scene is there while it moves');
    assert.ok(psnr(first, turned) < ALIKE, `${psnr(first, turned)} dB: it turned`);
    await page.locator('[aria-label="Back to the first view"]').evaluate((button) => button.click());
    assert.equal(psnr(await rested(), first), Infinity, 'the same view has the same picture');
    assert.ok(page.requests.every((url) => /^(file|blob|data):/.test(url)), page.requests.join('\n'));
  }, { skip: !built && 'LEXISPLAT_PAGE is not set' });

  test('the element draws what the program draws', async () => {
    await element(`src="/golden/${SCENE}" still`);
    const shown = await rested();
    const { renderer, device, view, drawn } = await page.evaluate(() => document.querySelector('lexi-viewer').report);
    assert.deepEqual([renderer, device], ['processor', 'processor']);
    assert.ok(drawn[0] > 0 && drawn[0] <= 2600, `${drawn[0]} Gaussians`);
    const { width, height, focal: [fx, fy], position, rotation } = view;
    assert.deepEqual([width, height], [SIZE.width, SIZE.height]);
    const cameras = [{ id: 0, img_name: 'view', width, height, fx, fy, position, rotation }];
    await writeFile(join(folder, 'cameras.json'), JSON.stringify(cameras));
    const out = join(folder, 'pictures');
    execFileSync(program, ['render', join(golden, SCENE), '--cameras', join(folder, 'cameras.json'), '--device', 'cpu', '-o', out, '--quiet']);
    const [name] = readdirSync(out).filter((file) => file.endsWith('.png'));
    const own = decodePng(await readFile(join(out, name)));
    assert.ok(psnr(own, shown) >= SAME, `${psnr(own, shown)} dB`);
  }, { skip: !program && 'LEXISPLAT_PROGRAM is not set' });

  test('the element draws within a budget', async () => {
    await element(`src="/golden/${SCENE}" budget="1500" still`);
    const state = await page.waitForFunction(() => {
      const stream = document.querySelector('lexi-viewer').report?.streams[0];
      return stream?.complete && stream;
    });
    const { drawn, splats } = await state.jsonValue();
    assert.ok(drawn === splats && splats > 0 && splats <= 1500, `${drawn} of ${splats}`);
    await rested();
  });

  test('the element compares two scenes, and saves its picture', async () => {
    await element(`src="/golden/${PACKED}" src2="/golden/${PLAIN}" mode="side" controls="all" still`);
    await page.waitForFunction(() => document.querySelector('lexi-viewer').report?.models.every(Boolean));
    await page.waitForFunction(() => document.querySelector('lexi-viewer').report.psnr !== null || document.querySelector('lexi-viewer').report.identical);
    const side = await rested();
    const report = await page.evaluate(() => document.querySelector('lexi-viewer').report);
    assert.ok(report.identical || report.psnr > SAME, `the PLY is what the other file says: ${report.psnr}`);
    const [left, right] = [0, SIZE.width / 2].map((from) => {
      const half = { width: SIZE.width / 2, height: SIZE.height, data: [] };
      for (let y = 0; y < SIZE.height; y++) half.data.push(...side.data.subarray(4 * (y * SIZE.width + from), 4 * (y * SIZE.width + from + half.width)));
      return half;
    });
    assert.ok(lit(left) > LIT && psnr(left, right) > SAME, `${psnr(left, right)} dB between both sides`);
    const download = page.waitForEvent('download');
    await page.keyboard.press('Tab');
    await page.locator('canvas[role]').focus();
    await page.keyboard.press('p');
    const saved = decodePng(await readFile(await (await download).path()));
    assert.equal(psnr(saved, side), Infinity, 'the picture that is saved is the one that is shown');
  });
});
