// The viewer as benches and tests call it in a page, without its controls.

import * as wasm from '../wasm/viewer.js';
import { show } from '../src/session.js';

const canvas = document.getElementById('canvas');
let viewer;
let env;
let heap;

async function start(workers = 2) {
  const module = await WebAssembly.compileStreaming(fetch('../wasm/viewer_bg.wasm'));
  ({ memory: heap } = wasm.initSync({ module }));
  env = { wasm: module, worker: () => new Worker(new URL('../src/viewer-worker.js', import.meta.url), { type: 'module' }), workers };
  viewer = await wasm.Viewer.create(canvas, '{}');
}

/** Loads a scene whole, and tells when its parts came. */
async function load(url, slot = 0, memory = Infinity) {
  const began = performance.now();
  const events = [];
  let last;
  const { info } = await show(url, {
    env,
    slot,
    memory,
    onForm: (bytes, info) => viewer.form(slot, bytes, JSON.stringify(info)),
    onPart: (index, bytes) => viewer.part(slot, index, bytes),
    onProgress: (progress) => {
      last = progress;
      events.push([performance.now() - began, progress.loaded, progress.decoded]);
    },
  });
  return { info, milliseconds: performance.now() - began, progress: last, events, report: JSON.parse(viewer.report()) };
}

let stream;
let last = Promise.resolve();

/** Calls `change` when the calls before are done, since those of a viewer may not overlap. */
function act(change) {
  last = last.then(change);
  return last;
}

/** Begins a scene of which a part is drawn within `budget`. Resolves when some of its first layer is there. */
async function begin(url, budget, asBlob = false) {
  let isBegun;
  const begun = new Promise((resolve) => (isBegun = resolve));
  const change = async ({ removed, parts }) => {
    removed.forEach((index) => viewer.remove_part(0, index));
    for (const { index, part } of parts) await viewer.part(0, index, part);
    isBegun();
  };
  const shown = show(asBlob ? await (await fetch(url)).blob() : url, {
    env,
    budget,
    onForm: (bytes, info) => act(() => viewer.form(0, bytes, JSON.stringify(info))),
    onChange: (changes) => act(() => change(changes)),
    onStream: (begun) => (stream = begun),
  });
  await Promise.race([shown, begun]);
}

/** Goes to the next camera and waits until all that it shows is there. Returns what came, and from where it is seen. */
async function fly() {
  const began = performance.now();
  stream.look(await act(() => (viewer.key(']'), JSON.parse(viewer.report()).eye)));
  await stream.settled();
  const milliseconds = performance.now() - began;
  const report = await act(() => JSON.parse(viewer.report()));
  return { milliseconds, camera: report.camera, gaussians: report.gaussians[0], resident: report.resident_bytes, wasm: heap.buffer.byteLength, js: performance.memory?.usedJSHeapSize, ...stream.state };
}

function resize(width, height) {
  [canvas.width, canvas.height] = [width, height];
  viewer.resize(width, height);
}

/** The picture of the present view at a size, as base64 of RGBA. */
async function picture(width, height, words = '') {
  resize(width, height);
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
  const bytes = new Uint8Array(await (await fetch(url)).arrayBuffer());
  await act(() => viewer.cameras(bytes));
}

window.bench = { start, load, begin, fly, resize, picture, cameras, viewer: () => viewer, show, env: () => env };
document.title = 'ready';
