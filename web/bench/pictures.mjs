// Pictures that the browser draws from codes against those of the processor.
//
//   LEXISPLAT_NPM=node_modules node web/bench/pictures.mjs PROGRAM SCENE.lexi[=CAMERAS.json]... [--views N] [--width N] [--json]
//
// PROGRAM is a built `lexisplat`. Of each scene N (3) test views are drawn N (320) pixels wide by `lexisplat render` and by
// the viewer in headless Chromium with WebGPU in software. It prints the PSNR of each model's worst view.

import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { basename, dirname, join, resolve } from 'node:path';
import { fileURLToPath } from 'node:url';
import { parseArgs } from 'node:util';
import { open } from 'lexisplat';
import { launch, psnr, serve } from '../test/support/chromium.mjs';
import { decodePng } from '../test/support/png.mjs';
import { openHarness } from './harness-page.mjs';

const web = dirname(dirname(fileURLToPath(import.meta.url)));
const { values, positionals } = parseArgs({
  allowPositionals: true,
  options: {
    views: { type: 'string', default: '3' },
    width: { type: 'string', default: '320' },
    json: { type: 'boolean', default: false },
  },
});
const [program, ...scenes] = positionals;
const views = Number(values.views);
const width = Number(values.width);

async function positionsOf(scene) {
  const opened = await open(readFileSync(scene));
  const { positions } = await opened.all();
  opened.close();
  return positions;
}

/** Cameras around the middle of some points, as of `cameras.json`. */
function around(positions, count, width) {
  const axis = (k) => Float32Array.from({ length: positions.length / 3 }, (_, i) => positions[3 * i + k]).sort();
  const at = (sorted, share) => sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))];
  const axes = [0, 1, 2].map(axis);
  const centre = axes.map((sorted) => at(sorted, 0.5));
  const radius = Math.hypot(...axes.map((sorted) => (at(sorted, 0.8) - at(sorted, 0.2)) / 2));
  return Array.from({ length: count }, (_, id) => {
    const turn = (2 * Math.PI * id) / count;
    const forward = [Math.sin(turn), 0, Math.cos(turn)];
    const right = [Math.cos(turn), 0, -Math.sin(turn)];
    const rotation = [0, 1, 2].map((row) => [right[row], row === 1 ? 1 : 0, forward[row]]);
    const position = centre.map((c, k) => c - 3 * radius * forward[k]);
    const height = Math.round((width * 2) / 3);
    return { id, img_name: `around_${id}`, width, height, position, rotation, fx: width, fy: width };
  });
}

const scratch = mkdtempSync(join(tmpdir(), 'lexisplat-pictures-'));
const browser = await launch();
const results = [];
try {
  for (const given of scenes) {
    const [scene, cameras] = given.split('=');
    const name = basename(scene);
    const folder = join(scratch, name);
    // The views: evenly spread test views, or those of an orbit.
    const viewsOf = async () => {
      if (!cameras) return around(await positionsOf(scene), views, width);
      const all = JSON.parse(readFileSync(cameras, 'utf8'));
      const test = all.filter((camera) => camera.split === 'test');
      const from = test.length > 0 ? test : all;
      return Array.from({ length: views }, (_, i) => from[Math.floor(((i + 0.5) * from.length) / views)]);
    };
    const chosen = await viewsOf();
    const file = join(scratch, `${name}.json`);
    const args = ['render', scene, '-o', folder, '--quiet', '--width', String(width), '--device', 'cpu', '--split', 'all'];
    writeFileSync(file, JSON.stringify(chosen));
    args.push('--cameras', file);
    execFileSync(program, args, { stdio: 'inherit' });
    const pictures = readdirSync(folder).sort().map((picture) => decodePng(readFileSync(join(folder, picture))));

    const server = await serve({ '/': web, '/scene': dirname(resolve(scene)), '/scratch': scratch });
    const page = await openHarness(browser, server);
    const loaded = await page.evaluate((url) => window.bench.load(url), `/scene/${name}`);
    await page.evaluate((url) => window.bench.cameras(url), `/scratch/${name}.json`);
    const found = [];
    for (const [i, expected] of pictures.entries()) {
      const drawn = await page.evaluate(([w, h, words]) => window.bench.picture(w, h, words), [expected.width, expected.height, `camera=${i}`]);
      found.push(psnr(expected, { ...drawn, data: Buffer.from(drawn.data, 'base64') }));
    }
    const { sh, geometry } = loaded.report.scene_bytes[0];
    const source = loaded.info.sourceGaussians;
    results.push({ name, bytes: loaded.info.bytes, gaussians: loaded.info.gaussians, source, sh: sh / source, geometry: geometry / source, psnr: found });
    await page.close();
    await server.close();
  }
} finally {
  await browser.close();
  rmSync(scratch, { recursive: true });
}
if (values.json) console.log(JSON.stringify(results));
else {
  console.log('| scene | bytes | Gaussians of the source | worst view, dB | SH on the GPU, bytes a Gaussian of the source | geometry |\n|---|---|---|---|---|---|');
  for (const r of results) {
    console.log(`| ${r.name} | ${r.bytes} | ${r.source} | ${Math.min(...r.psnr).toFixed(1)} | ${r.sh.toFixed(1)} | ${r.geometry.toFixed(1)} |`);
  }
}
