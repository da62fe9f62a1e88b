// A page that is built by vite, webpack and esbuild from the package as npm installs it: it decodes, and the element draws.

import assert from 'node:assert/strict';
import { cpSync, existsSync, mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, describe, it } from 'node:test';
import { fileURLToPath, pathToFileURL } from 'node:url';
import { launch, npm, serve } from './support/chromium.mjs';

const web = fileURLToPath(new URL('..', import.meta.url));
const golden = fileURLToPath(new URL('../../crates/lexisplat/tests/golden', import.meta.url));
// 300 Gaussians, and a file that is decoded whole.
const [SCENE, WHOLE] = ['packed3.lexi', 'f32.lexi'];
// WebGPU in software is slow, and processors may be busy: milliseconds.
const PATIENCE = 120_000;

const APP = `import { open } from 'lexisplat';
import 'lexisplat/viewer';

async function count(name) {
  const scene = await open(name);
  const { count, sh } = await scene.all({ as: 'dense' });
  scene.close();
  return [count, sh.length];
}

globalThis.result = (async () => {
  const viewer = document.querySelector('lexi-viewer');
  const load = () => new Promise((done, failed) => {
    viewer.addEventListener('load', ({ detail }) => done(detail.gaussians), { once: true });
    viewer.addEventListener('error', ({ detail }) => failed(new Error(detail.message)), { once: true });
  });
  const loaded = load();
  // Drawing takes longest.
  if (!location.pathname.includes('inline')) viewer.src = '/golden/${SCENE}';
  else await customElements.get('lexi-viewer').program.compile();
  const found = { layered: await count('/golden/${SCENE}'), whole: await count('/golden/${WHOLE}'), drawn: viewer.src && (await loaded) };
  if (!viewer.src) return found;
  // The parts that draw on the processor are where the bundle has put them.
  const again = load();
  viewer.renderer = 'processor';
  await again;
  return { ...found, renderer: viewer.report.renderer };
})();
globalThis.result.catch(() => {});
`;
// As strict as the documentation says that a page may be; `data:` is for what vite puts into scripts.
const POLICY = `default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; worker-src 'self'; connect-src 'self' data:; img-src data:`;
const htmlOf = (script) => `<!doctype html><html lang="en"><head><title>app</title><link rel="icon" href="data:,">
<meta http-equiv="Content-Security-Policy" content="${POLICY}"></head><body><lexi-viewer></lexi-viewer>${script}</body></html>`;

/** Imports a package by its name from the folder that LEXISPLAT_NPM names. */
async function load(name) {
  const module = await import(pathToFileURL(createRequire(join(npm, 'x.js')).resolve(name)).href);
  return module.default?.build || typeof module.default === 'function' ? module.default : module;
}

/** Functions that build `app/main.js` into `app/<name>/` and return the script of the page there. */
const BUNDLERS = {
  async vite(app, options = {}) {
    const { build } = await load('vite');
    await build({ root: app, base: './', logLevel: 'error', build: { outDir: 'vite', ...options } });
  },
  // All that vite may put into the scripts themselves.
  vite_inline: (app) => BUNDLERS.vite(app, { outDir: 'vite_inline', assetsInlineLimit: 1 << 30 }),
  async webpack(app) {
    const webpack = await load('webpack');
    const stats = await new Promise((done, failed) => {
      const output = { path: join(app, 'webpack'), filename: 'main.js' };
      webpack({ mode: 'production', context: app, entry: './main.js', output, performance: false }, (error, stats) => (error ? failed(error) : done(stats)));
    });
    const { errors, warnings } = stats.toJson({ all: false, errors: true, warnings: true });
    assert.deepEqual([...errors, ...warnings].map(({ message }) => message), []);
    writeFileSync(join(app, 'webpack/index.html'), htmlOf('<script defer src="main.js"></script>'));
  },
  async esbuild(app) {
    const { build } = await load('esbuild');
    const { default: plugin } = await import(pathToFileURL(join(app, 'node_modules/lexisplat/esbuild.mjs')).href);
    const options = { bundle: true, format: 'esm', minify: true, splitting: true, logLevel: 'silent', plugins: [plugin()] };
    const { warnings } = await build({ entryPoints: [join(app, 'main.js')], outdir: join(app, 'esbuild'), ...options });
    assert.deepEqual(warnings.map(({ text }) => text), []);
    writeFileSync(join(app, 'esbuild/index.html'), htmlOf('<script type="module" src="main.js"></script>'));
  },
};

const missing = !npm ? 'LEXISPLAT_NPM is not set' : !existsSync(join(web, 'wasm/viewer_bg.wasm')) && 'the WebAssembly is not built';

describe('bundles', { skip: missing }, () => {
  let app;
  let browser;
  let server;
  before(async () => {
    app = mkdtempSync(join(tmpdir(), 'lexisplat-bundles-'));
    const installed = join(app, 'node_modules/lexisplat');
    mkdirSync(installed, { recursive: true });
    const { files } = JSON.parse(readFileSync(join(web, 'package.json'), 'utf8'));
    // npm leaves out files that do not exist: licences of others are gathered for a release only.
    for (const name of ['package.json', ...files].filter((name) => existsSync(join(web, name)))) cpSync(join(web, name), join(installed, name), { recursive: true });
    writeFileSync(join(app, 'package.json'), '{ "private": true, "type": "module" }');
    writeFileSync(join(app, 'main.js'), APP);
    writeFileSync(join(app, 'index.html'), htmlOf('<script type="module" src="./main.js"></script>'));
    [browser, server] = await Promise.all([launch(), serve({ '/': app, '/golden': golden })]);
  });
  after(async () => {
    await Promise.all([browser?.close(), server?.close()]);
    rmSync(app, { recursive: true });
  });

  for (const [name, build] of Object.entries(BUNDLERS)) {
    it(`${name}: the page decodes and draws`, { timeout: PATIENCE }, async () => {
      await build(app);
      for (const file of readdirSync(join(app, name), { recursive: true }).filter((file) => file.endsWith('.js'))) {
        assert.doesNotMatch(readFileSync(join(app, name, file), 'utf8'), /node:|worker_threads/, `${file} is for browsers`);
      }
      const page = await browser.newPage({ viewport: { width: 240, height: 160 }, reducedMotion: 'reduce' });
      const faults = [];
      page.on('pageerror', (error) => faults.push(String(error)));
      page.on('console', (message) => message.type() === 'error' && faults.push(message.text()));
      await page.goto(`${server.url}/${name}/index.html`);
      await page.waitForFunction(() => globalThis.result).catch((error) => {
        throw new Error(`${error}: ${faults}`);
      });
      const { layered, whole, drawn, renderer } = await page.evaluate(() => globalThis.result);
      assert.deepEqual(faults, []);
      assert.ok(layered[0] > 0 && layered[1] > 0 && whole[0] > 0, JSON.stringify({ layered, whole }));
      if (!name.includes('inline')) assert.deepEqual([drawn, renderer], [layered[0], 'processor']);
      await page.close();
    });
  }
});
