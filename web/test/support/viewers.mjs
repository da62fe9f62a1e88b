// Pages of other viewers that show a file by our loader or a PLY by their own, and the steps that their tests share.

import assert from 'node:assert/strict';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before } from 'node:test';
import { fileURLToPath } from 'node:url';
import { open } from 'lexisplat';
import { launch, npm, psnr, serve, shot } from './chromium.mjs';
import { plyOf } from './ply.mjs';
import { orbit } from './views.mjs';

const web = fileURLToPath(new URL('../..', import.meta.url));
// Milliseconds; drawing without a GPU takes long.
const PATIENCE = 120_000;
// Bytes with which the first layer of packed3_layers is there, and how like the whole it is at least, dB.
const HELD = 12_000;
const COARSE = 15;

/** Least PSNR of two pictures that are alike, which the issue asks for, dB. */
export const ALIKE = 45;
/** Sides of the pictures that are compared, pixels. */
export const SIZE = 256;

/** The folder of the golden files. */
export const golden = fileURLToPath(new URL('../../../crates/lexisplat/tests/golden', import.meta.url));

/** The header of a golden file and all of it, with dense SH. */
export async function dense(name) {
  const scene = await open(readFileSync(join(golden, `${name}.lexi`)), { workers: 0 });
  const chunk = await scene.all({ as: 'dense' });
  scene.close();
  return { header: scene.header, chunk };
}

/**
 * Serves the package, those of LEXISPLAT_NPM as it would find them, and further files.
 * @param {Record<string, string>} files the file or folder of each further path
 */
export const serveViewers = (files) => serve({ '/': web, '/node_modules': npm, '/node_modules/lexisplat': web, ...files });

/**
 * Opens a page of test/support.
 * @param {import('playwright-core').Browser} browser
 * @param {string} address of the page
 * @returns {Promise<{page: import('playwright-core').Page, faults: string[], call: (name: string, argument?: unknown) => Promise<any>,
 *     picture: (view: object) => Promise<{width: number, height: number, data: Uint8Array}>}>} faults: errors of the page so
 *     far; call: a function of its `viewer`; picture: of a view, as the page shows it
 */
export async function openViewer(browser, address) {
  const page = await browser.newPage({ viewport: { width: 640, height: 640 } });
  page.setDefaultTimeout(PATIENCE);
  const faults = [];
  page.on('pageerror', (error) => faults.push(String(error)));
  page.on('console', (message) => message.type() === 'error' && faults.push(message.text()));
  await page.goto(address);
  await page.waitForFunction(() => window.viewer);
  const call = (name, argument) => page.evaluate(([name, argument]) => window.viewer[name](argument), [name, argument]);
  const picture = async (view) => {
    await call('draw', view);
    return shot(page, 'canvas');
  };
  return { page, faults, call, picture };
}

/** The share of a picture's pixels that are not nearly black, so that a test knows that something was drawn. */
export function lit({ width, height, data }) {
  let sum = 0;
  for (let i = 0; i < data.length; i += 4) if (Math.max(data[i], data[i + 1], data[i + 2]) > 16) sum++;
  return sum / (width * height);
}

/**
 * Gives the tests of a viewer a browser, a server of its page and of scenes, and a folder that is served as /ply.
 * @param {string} name of its page in test/support, and of its example
 * @param {string} needed packages
 * @param {number} [mostDegree] highest degree of SH of the PLYs that it is given
 */
export function setUp(name, needed, mostDegree) {
  const skip = npm ? false : `LEXISPLAT_NPM names no folder with ${needed} and playwright-core`;
  const folder = mkdtempSync(join(tmpdir(), `lexisplat-${name}-`));
  // Opening a page costs seconds without a GPU, so tests share one for each backend.
  const viewers = {};
  let browser;
  let server;
  before(async () => {
    if (skip) return;
    const examples = { '/examples/scene.lexi': join(golden, 'packed3_layers.lexi') };
    server = await serveViewers({ '/golden': golden, '/ply': folder, ...examples });
    browser = await launch();
  });
  after(async () => {
    await browser?.close();
    await server?.close();
    rmSync(folder, { recursive: true });
  });
  return {
    skip,
    folder,
    /** The viewer's page with this backend. */
    shown: (backend = '') => (viewers[backend] ??= openViewer(browser, `${server.url}/test/support/${name}.html?${backend.toLowerCase()}`)),
    /** Writes the PLY of a golden scene and gives the scene. */
    async decompressed(scene) {
      const decoded = await dense(scene);
      writeFileSync(join(folder, `${scene}.ply`), plyOf(decoded.header.degree, decoded.chunk, mostDegree));
      return decoded;
    },
    /** Opens the viewer's example and waits until it draws. */
    async assertExampleDraws() {
      const page = await browser.newPage({ viewport: { width: SIZE, height: SIZE } });
      const faults = [];
      page.on('pageerror', (error) => faults.push(String(error)));
      await page.goto(`${server.url}/examples/${name}.html`);
      await page.waitForSelector('canvas');
      let picture;
      do picture = await shot(page, 'canvas');
      while (lit(picture) < 0.1 && faults.length === 0);
      assert.deepEqual(faults, []);
      await page.close();
    },
  };
}

/** Pictures of views of the scene that `viewer` shows when it is given `argument`. */
export async function picturesOf(viewer, views, argument) {
  await viewer.call('show', argument);
  const pictures = [];
  for (const view of views) pictures.push(await viewer.picture(view));
  return pictures;
}

/** Fails unless each picture shows something and is like the other of its view, and pictures of two views differ. */
export function assertAlike(ours, theirs) {
  for (const [i, picture] of ours.entries()) {
    assert.ok(lit(picture) > 0.1, 'something is drawn');
    const alike = psnr(picture, theirs[i]);
    assert.ok(alike >= ALIKE, `view ${i}: ${alike} dB`);
  }
  for (const pictures of [ours, theirs]) {
    if (pictures.length > 1) assert.ok(psnr(...pictures) < ALIKE, 'pictures of two views differ');
  }
}

/** Fails unless `viewer` draws the first layer of a scene while the rest is held back, and all of it in the end. */
export async function assertFirstLayerIsDrawn(viewer, options = {}) {
  const url = '/golden/packed3_layers.lexi';
  const { chunk } = await dense('packed3_layers');
  const [view] = orbit(chunk.positions, 1, SIZE);
  const [whole] = await picturesOf(viewer, [view], { url, ...options });
  await viewer.call('begin', { url, bytes: HELD, ...options });
  const alike = psnr(await viewer.picture(view), whole);
  assert.ok(alike > COARSE && alike < ALIKE, `after the first layer: ${alike} dB`);
  await viewer.call('end');
  const last = psnr(await viewer.picture(view), whole);
  assert.ok(last >= ALIKE, `in the end: ${last} dB`);
  assert.deepEqual(viewer.faults, []);
}

/** Fails unless there is a stage before the last, and each has more Gaussians than the one before. */
export function assertGrowing(stages) {
  assert.ok(stages.length >= 1, 'something is shown before all is there');
  assert.ok(stages.every((stage, i) => i === 0 || stage.gaussians > stages[i - 1].gaussians), 'each has more Gaussians');
}
