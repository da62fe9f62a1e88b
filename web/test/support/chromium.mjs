// Parts that tests in a real browser share: headless Chromium with WebGPU and WebGL2 in software, a file server on localhost
// with ranges and a held rate, and pictures of what a page shows.
//
// Packages come from the folder of node_modules that LEXISPLAT_NPM names. CHROMIUM names another browser.

import { createReadStream } from 'node:fs';
import { stat } from 'node:fs/promises';
import { createServer } from 'node:http';
import { createRequire } from 'node:module';
import { extname, join, normalize, resolve, sep } from 'node:path';
import { pipeline } from 'node:stream/promises';
import { setTimeout as wait } from 'node:timers/promises';
import { decodePng } from './png.mjs';

/** The folder of node_modules that tests take packages from; undefined where none was named. */
export const npm = process.env.LEXISPLAT_NPM && resolve(process.env.LEXISPLAT_NPM);

const EXECUTABLE = process.env.CHROMIUM ?? '/usr/bin/chromium';
// Without both SwiftShader flags compute works, but a canvas of WebGPU stays white.
const GPU_FLAGS = ['--enable-unsafe-webgpu', '--enable-features=Vulkan', '--use-vulkan=swiftshader', '--use-angle=swiftshader'];
const FLAGS = [
  '--no-sandbox',
  '--no-first-run',
  '--disable-background-networking',
  '--disable-component-update',
  '--disable-sync',
  '--disable-quic',
];
const TYPES = {
  '.css': 'text/css',
  '.html': 'text/html; charset=utf-8',
  '.js': 'text/javascript',
  '.json': 'application/json',
  '.mjs': 'text/javascript',
  '.png': 'image/png',
  '.wasm': 'application/wasm',
};
// Pieces of a body, so small that a held rate is even: bytes.
const PIECE = 16 * 1024;

/**
 * Starts Chromium.
 * @param {string[]} [more] further flags
 * @param {{gpu?: boolean}} [options] gpu: whether there is WebGPU and WebGL, in software; without, the browser draws on the processor
 * @returns {Promise<import('playwright-core').Browser>}
 */
export async function launch(more = [], { gpu = true } = {}) {
  if (!npm) throw new Error('LEXISPLAT_NPM names no folder of node_modules with playwright-core');
  const { chromium } = createRequire(join(npm, 'x.js'))('playwright-core');
  return chromium.launch({ executablePath: EXECUTABLE, args: [...(gpu ? GPU_FLAGS : ['--disable-gpu']), ...FLAGS, ...more] });
}

/**
 * Serves folders on localhost, with ranges.
 * @param {string | Record<string, string>} folders one folder, or the folder (or file) of each path that an address may
 *     begin with; the longest that fits is taken
 * @param {{rate?: number}} [options] rate: most bytes a second of all answers together
 * @returns {Promise<{url: string, requests: {path: string, range?: string}[], close: () => Promise<void>}>} url has no
 *     slash at its end; requests lists what was asked for, in order
 */
export async function serve(folders, { rate } = {}) {
  const roots = Object.entries(typeof folders === 'string' ? { '/': folders } : folders)
    .map(([path, folder]) => ({ path: path.replace(/\/*$/, ''), folder: resolve(folder) }))
    .sort((a, b) => b.path.length - a.path.length);
  const requests = [];
  const link = { free: 0 };
  const server = createServer((request, response) => {
    answer(roots, requests, request, response, rate && { rate, link }).catch(() => response.destroy());
  });
  await new Promise((done) => server.listen(0, '127.0.0.1', done));
  const close = () =>
    new Promise((done) => {
      server.close(done);
      server.closeAllConnections();
    });
  return { url: `http://localhost:${server.address().port}`, requests, close };
}

async function answer(roots, requests, request, response, limit) {
  const path = decodeURIComponent(new URL(request.url, 'http://localhost').pathname);
  const range = request.headers.range;
  requests.push({ path, range });
  // Browsers ask for it by themselves, and a 404 would be an error in the page's console.
  if (path === '/favicon.ico') return void response.writeHead(204).end();
  const file = found(roots, path);
  const info = file && (await stat(file).catch(() => undefined));
  if (!info?.isFile()) return void response.writeHead(404).end();

  const headers = {
    'content-type': TYPES[extname(file)] ?? 'application/octet-stream',
    'accept-ranges': 'bytes',
    'cache-control': 'no-store',
  };
  const span = range === undefined ? { start: 0, end: info.size - 1 } : spanOf(range, info.size);
  if (!span) return void response.writeHead(416, { 'content-range': `bytes */${info.size}` }).end();
  headers['content-length'] = Math.max(0, span.end - span.start + 1);
  if (range !== undefined) headers['content-range'] = `bytes ${span.start}-${span.end}/${info.size}`;
  response.writeHead(range === undefined ? 200 : 206, headers);
  if (request.method === 'HEAD' || headers['content-length'] === 0) return void response.end();
  const body = createReadStream(file, { ...span, highWaterMark: PIECE });
  await pipeline(limit ? held(body, limit) : body, response);
}

function found(roots, path) {
  for (const root of roots) {
    if (path === root.path) return root.folder;
    if (!path.startsWith(`${root.path}/`)) continue;
    const file = normalize(join(root.folder, path.slice(root.path.length), path.endsWith('/') ? 'index.html' : ''));
    return file.startsWith(root.folder + sep) ? file : undefined;
  }
}

function spanOf(range, size) {
  const [, first, last] = /^bytes=(\d*)-(\d*)$/.exec(range) ?? [];
  if (first === undefined || (first === '' && last === '')) return undefined;
  const start = first === '' ? Math.max(0, size - Number(last)) : Number(first);
  const end = first === '' || last === '' ? size - 1 : Math.min(Number(last), size - 1);
  return start <= end ? { start, end } : undefined;
}

// All answers share one link: each piece takes its time on it, after the pieces before.
async function* held(stream, { rate, link }) {
  for await (const piece of stream) {
    link.free = Math.max(link.free, performance.now()) + (1000 * piece.length) / rate;
    await wait(link.free - performance.now());
    yield piece;
  }
}

/**
 * A picture of what an element shows.
 * @param {import('playwright-core').Page} page
 * @param {string} selector of CSS
 * @returns {Promise<{width: number, height: number, data: Uint8Array}>} data: 4 bytes a pixel, red, green, blue, alpha
 */
export async function shot(page, selector) {
  return decodePng(await page.locator(selector).screenshot({ animations: 'disabled' }));
}

/**
 * How alike two pictures of one size are, over red, green and blue.
 * @returns {number} PSNR in dB; Infinity where they are the same
 */
export function psnr(a, b) {
  if (a.width !== b.width || a.height !== b.height) throw new Error('the pictures are not of one size');
  let sum = 0;
  for (let i = 0; i < a.data.length; i++) if (i % 4 !== 3) sum += (a.data[i] - b.data[i]) ** 2;
  return 10 * Math.log10((255 ** 2 * 3 * a.width * a.height) / sum);
}
