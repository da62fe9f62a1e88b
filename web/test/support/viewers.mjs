// Pages of three.js and PlayCanvas that show a file by our loader or a PLY by their own.

import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { open } from 'lexisplat';
import { npm, serve, shot } from './chromium.mjs';

const web = fileURLToPath(new URL('../..', import.meta.url));
// Milliseconds; drawing without a GPU takes long.
const PATIENCE = 120_000;

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
