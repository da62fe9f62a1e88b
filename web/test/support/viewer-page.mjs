// Parts that tests of the viewer's page and element share: a browser, and the sources served with the stand-ins of test/stub.

import assert from 'node:assert/strict';
import { mkdtemp, rm, writeFile } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { it } from 'node:test';
import { fileURLToPath } from 'node:url';
import { serve } from './chromium.mjs';

const here = (path) => fileURLToPath(new URL(path, import.meta.url));
// The shortest module: its magic number and version.
const EMPTY_WASM = [0x00, 0x61, 0x73, 0x6d, 0x01, 0x00, 0x00, 0x00];

/** The folder of the package. */
export const web = here('../..');

/**
 * Serves the page with stand-ins for the WebAssembly and the session, and a folder for what a test makes at `/made/`.
 * @param {Record<string, string>} [more] further paths and their folders
 */
export async function serveStub(more = {}) {
  const made = await mkdtemp(join(tmpdir(), 'lexisplat-page-'));
  await writeFile(join(made, 'empty.wasm'), new Uint8Array(EMPTY_WASM));
  for (const name of ['first', 'second']) await writeFile(join(made, `${name}.lexi`), scene(name));
  const server = await serve({
    '/': web,
    '/made': made,
    '/wasm/viewer.js': here('../stub/viewer.js'),
    '/wasm/viewer_bg.wasm': join(made, 'empty.wasm'),
    '/wasm/processor_bg.wasm': join(made, 'empty.wasm'),
    '/src/processor-worker.js': here('../stub/processor-worker.js'),
    '/src/session.js': here('../stub/session.js'),
    ...more,
  });
  const close = async () => {
    await server.close();
    await rm(made, { recursive: true });
  };
  return { ...server, page: `${server.url}/src/viewer/page.html`, made, close };
}

/** A scene as the stand-in of the session reads it. */
export function scene(name, { gaussians = 12_345, parts = 5 } = {}) {
  return `lexi ${name} ${gaussians} ${parts}\n${'x'.repeat(100 * parts)}`;
}

/**
 * A page whose faults fail the test: errors that nobody caught, and breaches of its CSP.
 * @param {import('playwright-core').Browser} browser
 * @param {import('playwright-core').BrowserContextOptions} [options]
 */
export async function newPage(browser, options = {}) {
  const page = await browser.newPage({ viewport: { width: 900, height: 600 }, reducedMotion: 'reduce', ...options });
  page.faults = [];
  page.on('pageerror', (error) => page.faults.push(String(error)));
  page.on('console', (message) => {
    if (/Content Security Policy|Content-Security-Policy/.test(message.text())) page.faults.push(message.text());
  });
  return page;
}

/**
 * Gives a function that defines tests, which fail if the page that `opened` gives had faults, and closes the page.
 * @param {() => import('playwright-core').Page | undefined} opened
 * @param {object} [options] of every test; a test may have more of its own
 */
export function faultless(opened, options = {}) {
  return (name, run, own = {}) =>
    it(name, { ...options, ...own }, async () => {
      try {
        await run();
        assert.deepEqual(opened().faults, []);
      } finally {
        await opened()?.context().close();
      }
    });
}

/** Drops files on what `selector` finds. @param {{name: string, text: string}[]} files */
export function drop(page, selector, files, { shift = false } = {}) {
  return page.evaluate(
    ([selector, files, shiftKey]) => {
      const dataTransfer = new DataTransfer();
      for (const { name, text } of files) dataTransfer.items.add(new File([text], name));
      const target = document.querySelector(selector);
      for (const name of ['dragover', 'drop']) {
        target.dispatchEvent(new DragEvent(name, { dataTransfer, shiftKey, bubbles: true, cancelable: true, composed: true }));
      }
    },
    [selector, files, shift],
  );
}

/** Calls of the newest stand-in by the name of a function. */
export function calls(page, name) {
  return page.evaluate((name) => globalThis.viewers.at(-1).calls.filter((call) => call[0] === name), name);
}

/** Returns the report of the newest stand-in, as soon as it does not draw. */
export function reportOf(page) {
  return page.evaluate(async () => {
    const viewer = globalThis.viewers.at(-1);
    while (viewer.busy) await new Promise((go) => setTimeout(go));
    return JSON.parse(viewer.report());
  });
}

/** Waits until a scene of this name is whole, by what the panel says. */
export function whole(page, name) {
  return page.locator('.card', { hasText: name }).filter({ hasText: 'Decoded in' }).waitFor();
}
