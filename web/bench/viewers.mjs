// How alike three.js, Spark, Babylon.js and PlayCanvas show a .lexi by our loaders and the decompressed PLY by their own,
// the bytes of each on the GPU, and how long each takes to load.
//
// LEXISPLAT_NPM=node_modules node bench/viewers.mjs SCENE.lexi SCENE.ply [CAMERAS.json | -] [PICTURES] [VIEWS]
//
// CAMERAS.json is INRIA's; its test views are taken, or all if it marks none; without it, views are around the scene.
// PICTURES is a folder of `lexisplat render SCENE.lexi --cameras CAMERAS.json --split test --width 256`, beside which both
// are put. VIEWS is how many views are drawn at most.

import { existsSync, readdirSync, readFileSync } from 'node:fs';
import { join, resolve } from 'node:path';
import { open } from 'lexisplat';
import { launch, psnr } from '../test/support/chromium.mjs';
import { decodePng } from '../test/support/png.mjs';
import { openViewer, serveViewers } from '../test/support/viewers.mjs';
import { orbit, scaled } from '../test/support/views.mjs';

// Width of pictures, pixels.
const WIDTH = 256;
// Times that a file is loaded for the time that it takes, after those for pictures.
const LOADS = 5;
const [lexi, ply, cameras = '-', pictures, most = '3'] = process.argv.slice(2);

const scene = await open(readFileSync(lexi), { workers: 0, shParts: 0 });
const { gaussians } = scene.header;
const { positions } = await scene.all({ as: 'dense' });
scene.close();
const views = viewsOf(cameras).slice(0, Number(most));

function viewsOf(path) {
  if (path === '-') return orbit(positions, Number(most), WIDTH);
  const all = JSON.parse(readFileSync(path));
  const marked = all.filter(({ split }) => split === 'test');
  return (marked.length > 0 ? marked : all).map((view) => scaled(view, WIDTH));
}

// The program names pictures by the photos' names, with or without a number before.
function rendered({ img_name }) {
  if (!pictures || !existsSync(pictures)) return undefined;
  const stem = String(img_name).replace(/\.[^.]*$/, '');
  const name = readdirSync(pictures).find((file) => file.endsWith('.png') && file.includes(stem));
  return name && decodePng(readFileSync(join(pictures, name)));
}

const server = await serveViewers({ '/scene.lexi': resolve(lexi), '/scene.ply': resolve(ply) });
const browser = await launch();
// The worst of the views of which there are two pictures.
const dB = (values) => {
  const known = values.filter((value) => value !== undefined);
  return known.length > 0 ? Math.min(...known).toFixed(1) : '-';
};

console.log(`${gaussians} Gaussians, ${views.length} views of ${WIDTH} pixels; PSNR in dB of the worst`);
console.log('| viewer | ours beside its own | its own beside itself, loaded again | bytes a Gaussian, ours | its own | ms to load, ours | its own | ours beside our renderer | its own beside it |');
console.log('|---|---|---|---|---|---|---|---|---|');
const cases = [
  ['three.js', 'three', 'webgpu'],
  ['three.js', 'three', 'webgl2'],
  ['Spark, dense SH', 'spark', 'webgl2'],
  ['Spark, codes', 'spark', 'webgl2', { as: 'codes' }],
  ['Babylon.js', 'babylon', 'webgpu'],
  ['Babylon.js', 'babylon', 'webgl2'],
  ['PlayCanvas', 'playcanvas', 'webgpu'],
  ['PlayCanvas', 'playcanvas', 'webgl2'],
];
for (const [name, file, backend, options] of cases) {
  const viewer = await openViewer(browser, `${server.url}/test/support/${file}.html?${backend}`);
  const [lexiFile, plyFile] = [{ url: '/scene.lexi', ...options }, { url: '/scene.ply' }];
  const drawn = async (given) => {
    await viewer.call('show', given);
    const shown = [];
    for (const view of views) shown.push(await viewer.picture(view));
    return { shown, bytes: await viewer.call('bytes') };
  };
  const own = await drawn(plyFile);
  const again = await drawn(plyFile);
  const ours = await drawn(lexiFile);
  const times = await loadTimes(viewer, [lexiFile, plyFile]);
  const beside = (a, b) => dB(a.shown.map((picture, i) => psnr(picture, b.shown[i])));
  const truth = views.map(rendered);
  const besideTruth = (a) => dB(a.shown.map((picture, i) => truth[i] && psnr(picture, truth[i])));
  const each = ({ bytes }) => (bytes / gaussians).toFixed(1);
  const row = [`${name}, ${await viewer.call('backend')}`, beside(ours, own), beside(again, own), each(ours), each(own), ...times, besideTruth(ours), besideTruth(own)];
  console.log(`| ${row.join(' | ')} |`);
  if (viewer.faults.length > 0) console.error(viewer.faults.join('\n'));
  await viewer.page.close();
}
await browser.close();
await server.close();

// Median and least of the milliseconds until a viewer has a file, for each of some in turn. Nothing is drawn.
async function loadTimes(viewer, files) {
  const times = files.map(() => []);
  for (let i = 0; i < LOADS; i++) {
    for (const [k, given] of files.entries()) {
      times[k].push(await viewer.page.evaluate(async (given) => {
        const began = performance.now();
        await window.viewer.show(given);
        return performance.now() - began;
      }, given));
    }
  }
  return times.map((all) => {
    all.sort((a, b) => a - b);
    return `${Math.round(all[LOADS >> 1])} (${Math.round(all[0])})`;
  });
}
