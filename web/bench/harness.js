// What the benches and tests call in a page: the viewer without its controls.

import * as wasm from '../wasm/viewer.js';
import { show } from '../src/session.js';

const canvas = document.getElementById('canvas');
let viewer;
let env;

async function start(workers = 2) {
  const module = await WebAssembly.compileStreaming(fetch('../wasm/viewer_bg.wasm'));
  wasm.initSync({ module });
  env = { wasm: module, worker: () => new Worker(new URL('../src/viewer-worker.js', import.meta.url), { type: 'module' }), workers };
  viewer = await wasm.Viewer.create(canvas, '{}');
}

/** Loads a scene whole, and tells when its parts came. */
async function load(url, slot = 0, budget = Infinity) {
  const began = performance.now();
  const events = [];
  let last;
  const { info } = await show(url, {
    env,
    slot,
    budget,
    onForm: (bytes, info) => viewer.form(slot, bytes, JSON.stringify(info)),
    onPart: (index, bytes) => viewer.part(slot, index, bytes),
    onProgress: (progress) => {
      last = progress;
      events.push([performance.now() - began, progress.loaded, progress.decoded]);
    },
  });
  return { info, milliseconds: performance.now() - began, progress: last, events, report: JSON.parse(viewer.report()) };
}

/** The picture of the present view at a size, as base64 of RGBA. */
async function picture(width, height, words = '') {
  [canvas.width, canvas.height] = [width, height];
  viewer.resize(width, height);
  if (words) viewer.run(words);
  await viewer.draw(1);
  const { width: w, height: h, data } = await viewer.picture();
  return { width: w, height: h, data: base64(data), report: JSON.parse(viewer.report()) };
}

function base64(bytes) {
  let text = '';
  for (let at = 0; at < bytes.length; at += 0x8000) text += String.fromCharCode(...bytes.subarray(at, at + 0x8000));
  return btoa(text);
}

async function cameras(url) {
  viewer.cameras(new Uint8Array(await (await fetch(url)).arrayBuffer()));
}

window.bench = { start, load, picture, cameras, viewer: () => viewer, show, env: () => env };
document.title = 'ready';
