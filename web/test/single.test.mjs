// The viewer's page of one file, opened from disk in Chromium, with stand-ins for the WebAssembly and the session.

import assert from 'node:assert/strict';
import { mkdtemp, rm, writeFile } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, describe, it } from 'node:test';
import { fileURLToPath, pathToFileURL } from 'node:url';
import { buildPage } from '../build-page.mjs';
import { launch, npm } from './support/chromium.mjs';
import { drop, faultless, newPage, reportOf, scene, whole } from './support/viewer-page.mjs';

const here = (path) => fileURLToPath(new URL(path, import.meta.url));
const STILL = 'data:image/gif;base64,R0lGODlhAQABAIAAAP///wAAACwAAAAAAQABAAACAkQBADs=';
// Most bytes of the page without the WebAssembly.
const MOST = 120_000;

describe('the page of one file', { skip: !npm && 'LEXISPLAT_NPM is not set' }, () => {
  let browser;
  let folder;
  let html;
  let page;
  before(async () => {
    folder = await mkdtemp(join(tmpdir(), 'lexisplat-single-'));
    await writeFile(join(folder, 'empty.wasm'), new Uint8Array([0x00, 0x61, 0x73, 0x6d, 0x01, 0x00, 0x00, 0x00]));
    const options = {
      wasm: join(folder, 'empty.wasm'),
      worker: here('stub/worker.js'),
      processor: join(folder, 'empty.wasm'),
      processorWorker: here('stub/processor-worker.js'),
      instead: { [here('../wasm/viewer.js')]: here('stub/viewer.js'), [here('../src/session.js')]: here('stub/session.js') },
    };
    [browser, html] = await Promise.all([launch(), buildPage(options)]);
  });
  after(async () => {
    await browser?.close();
    await rm(folder, { recursive: true });
  });

  /** Opens the page from disk after replacements of text, as the program does them. */
  const open = async (replacements = [], { hash = '', init } = {}) => {
    const text = replacements.reduce((text, [marker, by]) => {
      assert.equal(text.split(marker).length, 2, `${marker} is there once`);
      return text.replace(marker, () => by);
    }, html);
    await writeFile(join(folder, 'scene.html'), text);
    page = await newPage(browser);
    page.asked = [];
    page.on('request', (request) => page.asked.push(request.url()));
    if (init) await page.addInitScript(init);
    await page.goto(pathToFileURL(join(folder, 'scene.html')).href + hash);
  };
  const carried = (id, name, text = scene(name)) => [
    `id="${id}" data-name=""></script>`,
    `id="${id}" data-name="${name}">${Buffer.from(text).toString('base64')}</script>`,
  ];
  const test = faultless(() => page);

  test('shows the scene that it carries, with nothing from anywhere', async () => {
    await open([carried('scene', 'garden.lexi'), ['<title>lexisplat</title>', '<title>A garden</title>']]);
    await whole(page, 'garden.lexi');
    const { models } = await reportOf(page);
    assert.deepEqual([models[0].name, models[0].gaussians], ['garden.lexi', 12_345]);
    const outside = page.asked.filter((address) => !/^(blob|data):/.test(address));
    assert.deepEqual(outside, [pathToFileURL(join(folder, 'scene.html')).href]);
    assert.equal(await page.evaluate(() => document.getElementById('scene').textContent), '', 'the text is dropped');
  });

  test('shows two scenes as its words say', async () => {
    await open([carried('scene', 'a.lexi'), carried('scene2', 'b.lexi'), ['data-words=""', 'data-words="mode=side,degree=1"']]);
    await Promise.all([whole(page, 'a.lexi'), whole(page, 'b.lexi')]);
    const { mode, degree, models } = await reportOf(page);
    assert.deepEqual([mode, degree, models[1].name], ['side', 1, 'b.lexi']);
  });

  test('without a scene takes files', async () => {
    await open();
    await page.getByText('Open a scene').waitFor();
    await drop(page, 'body', [{ name: 'own.ply', text: scene('own') }]);
    await whole(page, 'own.ply');
  });

  test('restores the view of a link to it', async () => {
    await open([carried('scene', 'garden.lexi')], { hash: '#mode=first&split=0.5&turn=0.7:0.1&at=0:0:2' });
    await whole(page, 'garden.lexi');
    await page.waitForFunction(() => globalThis.viewers[0].view.turn[0] === 0.7);
  });

  test('says what is wrong with the scene that it carries', async () => {
    await open([carried('scene', 'bad.lexi', 'nonsense')]);
    await page.locator('.message', { hasText: 'bad.lexi: this is not a scene that can be read.' }).waitFor();
    await page.close();
    await open([['id="scene" data-name=""></script>', 'id="scene" data-name="broken.lexi">?=?</script>']]);
    await page.locator('.message', { hasText: 'broken.lexi' }).waitFor();
  });

  test('without WebGPU draws on the processor', async () => {
    await open([carried('scene', 'garden.lexi')], { init: () => delete Navigator.prototype.gpu });
    await whole(page, 'garden.lexi');
    assert.equal((await reportOf(page)).renderer, 'processor');
    assert.ok(page.asked.every((url) => /^(file|blob|data):/.test(url)), page.asked.join('\n'));
  });

  test('without WebGPU and WebAssembly says so and shows its still picture', async () => {
    const init = () => delete globalThis.WebAssembly;
    await open([carried('scene', 'garden.lexi'), ['data-poster=""', `data-poster="${STILL}"`]], { init });
    await page.getByText('This browser has no WebAssembly with SIMD').waitFor();
    assert.equal(await page.locator('.poster').isVisible(), true);
  });

  it('is small beside the WebAssembly', () => {
    assert.ok(html.length < MOST, `${html.length} bytes`);
  });
});
