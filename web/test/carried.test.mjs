// The page that the program carries, as `lexisplat html` writes it: it shows what the page shows that was just built, and its
// still picture lies under its first view.
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
/** Pixels by which a still picture is moved for comparison, besides one. */
const MOVED = 3;
/** Least likeness of the still picture and the view, in decibels. */
const STILL = 28;
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

  /** Returns the picture of the page at `path` at rest, without its panel. */
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
    execFileSync(program, ['html', golden, '-o', carried, '--tools', '--quiet']);
    const scene = (await readFile(golden)).toString('base64');
    const marker = 'id="scene" data-name=""></script>';
    const page = await readFile(built, 'utf8');
    assert.equal(page.split(marker).length, 2);
    const fresh = join(folder, 'fresh.html');
    const [words] = /data-words="[^"]*"/.exec(await readFile(carried, 'utf8'));
    const filled = page.replace(marker, () => `id="scene" data-name="${SCENE}">${scene}</script>`).replace('data-words=""', () => words);
    await writeFile(fresh, filled);
    const [a, b] = [await shown(carried), await shown(fresh)];
    assert.ok(psnr(a, b) >= SAME, `${psnr(a, b)} dB`);
  });

  for (const [width, height] of [[400, 160], [160, 240]]) {
    it(`has its still picture under its first view: ${width} x ${height}`, { timeout: 3 * PATIENCE }, async () => {
      const path = join(folder, `${width}.html`);
      execFileSync(program, ['html', golden, '-o', path, '--quiet']);
      const picture = async (init) => {
        const page = await newPage(browser, { viewport: { width, height } });
        page.setDefaultTimeout(PATIENCE);
        if (init) await page.addInitScript(init);
        await page.goto(pathToFileURL(path).href);
        if (init) await page.locator('.notice').waitFor();
        else {
          await page.locator('.app.shown').waitFor();
          // The thin bar is there while more of the scene comes.
          await page.locator('progress.thin').waitFor({ state: 'hidden' });
          await page.locator('canvas[aria-busy=false]').waitFor();
        }
        await page.evaluate(() => {
          const { shadowRoot } = document.getElementById('viewer');
          for (const over of shadowRoot.querySelectorAll('.notice, .hint, .dock, .overlay')) over.hidden = true;
        });
        const shown = await shot(page, '.view');
        assert.deepEqual(page.faults, []);
        await page.close();
        return shown;
      };
      const view = await picture();
      const still = await picture(() => delete globalThis.WebAssembly);
      // The still picture covers 16 by 9 whose shorter side is that of the window. Beside it there is nothing.
      const short = Math.min(width, height);
      const edge = [(width - (short * 16) / 9) / 2, (height - short) / 2].map((side) => Math.max(0, Math.ceil(side)) + MOVED);
      const error = ([right, down]) => {
        let [sum, count] = [0, 0];
        for (let y = edge[1]; y < height - edge[1]; y++) {
          for (let x = edge[0]; x < width - edge[0]; x++) {
            const [a, b] = [4 * (y * width + x), 4 * ((y + down) * width + x + right)];
            for (let c = 0; c < 3; c++, count++) sum += (view.data[a + c] - still.data[b + c]) ** 2;
          }
        }
        return sum / count;
      };
      const moves = [-1, 1, -MOVED, MOVED].flatMap((step) => [[step, 0], [0, step]]);
      const best = moves.reduce((a, b) => (error(b) < error(a) ? b : a), [0, 0]);
      assert.deepEqual(best, [0, 0], 'moved by these pixels it would lie better');
      // JPEG, and another size.
      const decibels = 10 * Math.log10(255 ** 2 / error([0, 0]));
      assert.ok(decibels > STILL, `${decibels} dB`);
    });
  }
});
