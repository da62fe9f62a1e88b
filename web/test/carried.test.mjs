// The page that the program carries, as `lexisplat html` writes it, beside the page that was just built: both show the same.
//
// LEXISPLAT_PROGRAM names a built `lexisplat`, LEXISPLAT_PAGE the built page.

import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtemp, readFile, rm, writeFile } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, describe, it } from 'node:test';
import { fileURLToPath, pathToFileURL } from 'node:url';
import { launch, npm, psnr, shot } from './support/chromium.mjs';
import { newPage } from './support/viewer-page.mjs';

const SCENE = 'packed3_layers.lexi';
const golden = fileURLToPath(new URL(`../../crates/lexisplat/tests/golden/${SCENE}`, import.meta.url));
const { LEXISPLAT_PROGRAM: program, LEXISPLAT_PAGE: built } = process.env;
const missing = [!npm && 'LEXISPLAT_NPM', !program && 'LEXISPLAT_PROGRAM', !built && 'LEXISPLAT_PAGE'].filter(Boolean).join(' and ');
/** Time for a page to draw in software, in milliseconds. */
const PATIENCE = 120_000;
/** Share of the pixels that are not black in a picture of the scene, at least. */
const LIT = 0.05;
/** Least likeness of the same picture drawn twice, in decibels: compilers may round otherwise. */
const SAME = 60;

describe('the page that the program carries', { skip: missing ? `${missing} not set` : false }, () => {
  let browser;
  let folder;
  before(async () => {
    folder = await mkdtemp(join(tmpdir(), 'lexisplat-carried-'));
    browser = await launch();
  });
  after(async () => {
    await browser?.close();
    await rm(folder, { recursive: true });
  });

  /** What the page at `path` shows at rest, without its panel. */
  async function shown(path) {
    const page = await newPage(browser, { viewport: { width: 320, height: 200 } });
    page.setDefaultTimeout(PATIENCE);
    const requests = [];
    page.on('request', (request) => requests.push(request.url()));
    await page.goto(pathToFileURL(path).href);
    // The panel is closed on a narrow page.
    await page.locator('.card', { hasText: SCENE }).filter({ hasText: 'Decoded in' }).waitFor({ state: 'attached' });
    await page.keyboard.press('h');
    // The canvas is busy while a finer picture is on its way.
    await page.locator('canvas[aria-busy=false]').waitFor();
    const picture = await shot(page, 'canvas');
    const lit = picture.data.filter((value, at) => at % 4 === 1 && value > 24).length / (picture.data.length / 4);
    assert.ok(lit > LIT, `${lit} of the picture is lit`);
    assert.deepEqual(page.faults, []);
    assert.ok(requests.every((url) => /^(file|blob|data):/.test(url)), requests.join('\n'));
    await page.close();
    return picture;
  }

  it('draws what the page draws that was just built', { timeout: 3 * PATIENCE }, async () => {
    const carried = join(folder, 'carried.html');
    execFileSync(program, ['html', golden, '-o', carried, '--quiet']);
    const scene = (await readFile(golden)).toString('base64');
    const place = 'id="scene" data-name=""></script>';
    const page = await readFile(built, 'utf8');
    assert.equal(page.split(place).length, 2);
    const fresh = join(folder, 'fresh.html');
    await writeFile(fresh, page.replace(place, () => `id="scene" data-name="${SCENE}">${scene}</script>`));
    const [a, b] = [await shown(carried), await shown(fresh)];
    assert.ok(psnr(a, b) >= SAME, `${psnr(a, b)} dB`);
  });
});
