// The npm package in Node: what it decodes against what the program writes, and what it does with anything else.
//
// LEXISPLAT_PROGRAM names a built `lexisplat`; without it nothing is compared with its PLYs.

import assert from 'node:assert/strict';
import { execFileSync, spawnSync } from 'node:child_process';
import { mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync, symlinkSync, writeFileSync } from 'node:fs';
import { createServer } from 'node:http';
import { tmpdir } from 'node:os';
import { join, relative } from 'node:path';
import { after, mock, test } from 'node:test';
import { fileURLToPath, pathToFileURL } from 'node:url';
import { open } from 'lexisplat';
import { sourceOf } from '../src/source.js';

const golden = fileURLToPath(new URL('../../crates/lexisplat/tests/golden/', import.meta.url));
const files = readdirSync(golden).filter((file) => file.endsWith('.lexi'));
const layered = readFileSync(join(golden, 'packed3_layers.lexi'));
const web = fileURLToPath(new URL('..', import.meta.url));
const { LEXISPLAT_PROGRAM: program, LEXISPLAT_NPM: npm } = process.env;
const scratch = mkdtempSync(join(tmpdir(), 'lexisplat-open-'));
after(() => rmSync(scratch, { recursive: true }));

/** Bytes of the types of a PLY. */
const SIZES = { char: 1, uchar: 1, short: 2, ushort: 2, int: 4, uint: 4, float: 4, double: 8 };

/** The properties of a binary PLY: their names, and those of floats by name. */
function plyOf(path) {
  const bytes = readFileSync(path);
  const end = bytes.indexOf('end_header\n') + 'end_header\n'.length;
  const lines = bytes.toString('latin1', 0, end).split('\n');
  const count = Number(lines.find((line) => line.startsWith('element vertex ')).split(' ')[2]);
  const offsets = new Map();
  let row = 0;
  for (const [, type, name] of lines.filter((line) => line.startsWith('property ')).map((line) => line.split(' '))) {
    offsets.set(name, row);
    row += SIZES[type];
  }
  const view = new DataView(bytes.buffer, bytes.byteOffset + end, bytes.length - end);
  assert.equal(view.byteLength, count * row);
  const column = (name) => Float32Array.from({ length: count }, (_, i) => view.getFloat32(i * row + offsets.get(name), true));
  return { count, names: [...offsets.keys()], column };
}

/** The indices of Gaussians in the order of their positions: a file may keep the order of its source, which `open` does not. */
function sorted(count, coordinate) {
  const xyz = [0, 1, 2].map(coordinate);
  const compare = (a, b) => xyz.reduce((found, axis) => found || axis[a] - axis[b], 0);
  return Array.from({ length: count }, (_, i) => i).sort(compare);
}

/** Column `k` of rows of `width` numbers. */
function columnOf(rows, width, k) {
  return Float32Array.from({ length: rows.length / width }, (_, i) => rows[i * width + k]);
}

/** The number that half floats' bits stand for. */
function half(bits) {
  const [sign, exponent, fraction] = [bits >> 15 ? -1 : 1, (bits >> 10) & 31, bits & 1023];
  return sign * (exponent === 0 ? fraction * 2 ** -24 : (1 + fraction / 1024) * 2 ** (exponent - 15));
}

for (const file of files) {
  test(`${file} is decoded to what the program writes`, { skip: program ? false : 'LEXISPLAT_PROGRAM is not set' }, async () => {
    const path = join(scratch, `${file}.ply`);
    execFileSync(program, ['decompress', join(golden, file), '-o', path, '--quiet']);
    const ply = plyOf(path);
    for (const workers of [0, 2]) {
      const scene = await open(readFileSync(join(golden, file)), { workers });
      const all = await scene.all({ as: 'dense' });
      assert.equal(all.count, ply.count);
      const ours = sorted(ply.count, (k) => columnOf(all.positions, 3, k));
      const theirs = sorted(ply.count, (k) => ply.column('xyz'[k]));
      const same = (rows, width, k, column) => {
        const [own, written] = [columnOf(rows, width, k), ply.column(column)];
        assert.deepEqual(ours.map((i) => own[i]), theirs.map((i) => written[i]), column);
      };
      const named = [
        ['positions', 3, ['x', 'y', 'z']],
        ['scales', 3, ['scale_0', 'scale_1', 'scale_2']],
        ['rotations', 4, ['rot_0', 'rot_1', 'rot_2', 'rot_3']],
        ['opacities', 1, ['opacity']],
        ['dc', 3, ['f_dc_0', 'f_dc_1', 'f_dc_2']],
      ];
      for (const [name, width, columns] of named) {
        columns.forEach((column, k) => same(all[name], width, k, column));
      }
      const rest = ply.names.filter((name) => name.startsWith('f_rest_')).length;
      assert.equal(scene.dictionary.rest, rest);
      for (let k = 0; k < rest; k++) same(all.sh, rest, k, `f_rest_${k}`);
      scene.close();
    }
  });
}

test('codes stand for the dense arrays', async () => {
  for (const file of files) {
    const bytes = readFileSync(join(golden, file));
    const [coded, dense] = await Promise.all([open(bytes), open(bytes)]);
    const { atoms, rest, values: dictionary } = coded.dictionary;
    assert.equal(dictionary.length, atoms * rest);
    const { codes, count } = await coded.all();
    const { sh } = await dense.all({ as: 'dense' });
    let at = 0;
    const escapes = new Map([...codes.escapes.gaussians].map((g, k) => [g, k]));
    for (let i = 0; i < count; i++) {
      const row = new Float64Array(rest);
      for (let k = 0; k < codes.counts[i]; k++, at++) {
        const value = codes.values instanceof Uint16Array ? half(codes.values[at]) : codes.values[at];
        for (let j = 0; j < rest; j++) row[j] += value * dictionary[codes.indices[at] * rest + j];
      }
      if (escapes.has(i)) row.set(codes.escapes.rows.subarray(escapes.get(i) * rest, (escapes.get(i) + 1) * rest));
      for (let j = 0; j < rest; j++) assert.ok(Math.abs(row[j] - sh[i * rest + j]) < 1e-5, `${file}: ${i} ${j}`);
    }
    assert.equal(at, codes.indices.length);
    coded.close();
    dense.close();
  }
});

test('chunks get finer, and the last of each is as without', async () => {
  const scene = await open(layered);
  const last = new Map();
  let times = 0;
  for await (const chunk of scene.chunks({ as: 'dense', refine: true })) {
    last.set(chunk.index, chunk);
    times++;
  }
  assert.ok([...last.values()].every((chunk) => chunk.complete) && times >= last.size);
  scene.close();
  const whole = await open(layered);
  for await (const chunk of whole.chunks({ as: 'dense' })) {
    for (const name of ['positions', 'scales', 'opacities', 'dc', 'sh', 'rotations']) {
      assert.deepEqual(last.get(chunk.index)[name], chunk[name], name);
    }
  }
  await assert.rejects(whole.all(), /given once/);
  whole.close();
});

test('rows are those of a .splat', async () => {
  const [a, b] = [await open(layered), await open(layered)];
  const { rows, count } = await a.all({ as: 'rows' });
  const { positions, scales, opacities } = await b.all();
  assert.equal(rows.length, 32 * count);
  const view = new DataView(rows.buffer);
  for (let i = 0; i < count; i++) {
    assert.equal(view.getFloat32(32 * i + 4, true), positions[3 * i + 1]);
    assert.equal(view.getFloat32(32 * i + 20, true), Math.fround(Math.exp(scales[3 * i + 2])));
    assert.ok(Math.abs(rows[32 * i + 27] - 255 / (1 + Math.exp(-opacities[i]))) <= 0.5);
  }
  a.close();
  b.close();
});

/** A server of one file, which `answer` may change. */
async function served(bytes, answer, run) {
  const ranges = [];
  const server = createServer((request, response) => {
    ranges.push(request.headers.range);
    answer(request, response, bytes);
  });
  await new Promise((done) => server.listen(0, '127.0.0.1', done));
  try {
    await run(`http://localhost:${server.address().port}/a%20scene.lexi?x=1`, ranges);
  } finally {
    server.closeAllConnections();
    await new Promise((done) => server.close(done));
  }
}

const plain = (_, response, bytes) => response.writeHead(200, { 'content-length': bytes.length }).end(bytes);

function withRanges({ headers }, response, bytes) {
  const [, first = 0, last = ''] = /^bytes=(\d+)-(\d*)/.exec(headers.range ?? '') ?? [];
  const [from, to] = [Number(first), last === '' ? bytes.length : Math.min(Number(last) + 1, bytes.length)];
  const head = { 'content-length': to - from, 'accept-ranges': 'bytes' };
  if (headers.range) head['content-range'] = `bytes ${from}-${to - 1}/${bytes.length}`;
  response.writeHead(headers.range ? 206 : 200, head).end(bytes.subarray(from, to));
}

test('files are fetched, with and without ranges', async () => {
  for (const answer of [plain, withRanges]) {
    await served(layered, answer, async (url) => {
      const progress = [];
      const scene = await open(url, { onProgress: (p) => progress.push(p) });
      const { count } = await scene.all();
      assert.equal(count, scene.header.gaussians);
      assert.deepEqual([progress.at(-1).loaded, progress.at(-1).decoded], [layered.length, count]);
      assert.ok(progress.every((p) => p.total === layered.length && p.gaussians === count));
      scene.close();
    });
  }
});

test('ranges are given at the same time, and a server without them is told', async () => {
  const ends = (_, response) => response.writeHead(206, { 'content-range': `bytes 0-9/${layered.length}` }).end(layered.subarray(0, 4));
  const spans = [[100, 300], [0, 1], [layered.length - 5, layered.length], [200, 40_000]];
  const check = async (source) => {
    assert.ok(await source.hasRanges());
    const ranges = await Promise.all(spans.map(([from, to]) => source.range(from, to)));
    ranges.forEach((bytes, k) => assert.deepEqual(Buffer.from(bytes), layered.subarray(...spans[k])));
    await assert.rejects(source.range(layered.length - 1, layered.length + 1), /scene|f\.lexi/);
  };
  await check(sourceOf(layered));
  await check(sourceOf(new Blob([layered])));
  await served(layered, withRanges, (url) => check(sourceOf(url)));
  await served(layered, plain, async (url) => {
    assert.equal(await sourceOf(url).hasRanges(), false);
    await assert.rejects(sourceOf(url).range(0, 10), /no ranges/);
  });
  await served(layered, ends, (url) => assert.rejects(sourceOf(url).range(0, 10), /4 bytes came of those from 0 to 10/));
});

test('SH that is not asked for is not decoded', async () => {
  const scene = await open(layered, { shParts: 0 });
  const { codes, count } = await scene.all();
  assert.ok(count > 0 && codes.indices.length === 0);
  scene.close();
});

test('little memory is enough, where ranges can be fetched again', async () => {
  const whole = await open(layered);
  const expected = await whole.all({ as: 'dense' });
  whole.close();
  // The largest chunk and the start of the file have to fit.
  const scene = await open(layered, { memory: Math.floor(layered.length * 0.97) });
  const last = new Map();
  for await (const chunk of scene.chunks({ as: 'dense', refine: true })) last.set(chunk.index, chunk);
  for (const chunk of last.values()) {
    const { first, count } = chunk;
    assert.deepEqual(chunk.positions, expected.positions.subarray(3 * first, 3 * (first + count)));
    assert.deepEqual(chunk.scales, expected.scales.subarray(3 * first, 3 * (first + count)));
  }
  scene.close();
  await assert.rejects(async () => (await open(layered, { memory: 1000 })).all(), /limit|memory/i);
});

test('a cut connection, a wrong address and a wrong file are told', async () => {
  const cut = (_, response, bytes) => {
    response.writeHead(200, { 'content-length': bytes.length });
    response.write(bytes.subarray(0, bytes.length >> 1), () => response.destroy());
  };
  await served(layered, cut, async (url) => {
    const scene = await open(url);
    await assert.rejects(scene.all(), /a scene\.lexi: the connection was cut after \d+ of \d+ bytes/);
    scene.close();
  });
  await served(layered, (_, response) => response.writeHead(404).end(), async (url) => {
    await assert.rejects(open(url), /a scene\.lexi: the server answered 404/);
  });
  await assert.rejects(open('http://localhost:9/x.lexi'), /x\.lexi: it could not be fetched/);
  await served(layered, (_, response) => response.writeHead(200, { 'content-length': 0 }).end(), async (url) => {
    await assert.rejects(open(url), /a scene\.lexi: the file is empty/);
  });
  const page = Buffer.from('<!DOCTYPE html><title>no such page</title>');
  await served(page, plain, async (url) => assert.rejects(open(url), /a scene\.lexi: this is a web page, not a scene/));
  const closed = createServer();
  await new Promise((done) => closed.listen(0, '127.0.0.1', done));
  const { port } = closed.address();
  await new Promise((done) => closed.close(done));
  await assert.rejects(open(`http://127.0.0.1:${port}/x.lexi`), /x\.lexi: the server refuses connections/);
  await assert.rejects(open(new Uint8Array(0)), /the file is empty/);
  for (const wrong of [new TextEncoder().encode('ply\nformat'), new Uint8Array(5000).fill(0x7b)]) {
    await assert.rejects(open(wrong), /this is not a \.lexi file/);
  }
  await assert.rejects(open(5), /a source is/);
  const scene = await open(layered);
  await assert.rejects(scene.all({ as: 'pictures' }), /as is codes, dense, rows, not pictures/);
  scene.close();
});

test('paths and addresses of files are opened', async () => {
  const path = join(scratch, 'a scene.lexi');
  writeFileSync(path, layered);
  const whole = await open(layered);
  const { positions } = await whole.all();
  whole.close();
  for (const source of [path, relative(process.cwd(), path), pathToFileURL(path), pathToFileURL(path).href]) {
    const progress = [];
    const scene = await open(source, { onProgress: (p) => progress.push(p) });
    assert.deepEqual((await scene.all()).positions, positions);
    assert.equal(progress.at(-1).loaded, layered.length);
    scene.close();
  }
  await assert.rejects(open(join(scratch, 'none.lexi')), /none\.lexi: there is no such file/);
  await assert.rejects(open(scratch), /it is not a file/);
});

test('a stalled download is told', async () => {
  const half = (_, response, bytes) => response.writeHead(200, { 'content-length': bytes.length }).write(bytes.subarray(0, bytes.length >> 1));
  const stop = new AbortController();
  await served(layered, half, async (url) => {
    mock.timers.enable({ apis: ['setInterval'] });
    try {
      const progress = [];
      const scene = await open(url, { signal: stop.signal, onProgress: (p) => progress.push(p) });
      const all = scene.all();
      while (progress.length === 0 || progress.at(-1).loaded < layered.length >> 1) await new Promise((go) => setTimeout(go, 5));
      assert.ok(progress.every(({ stalled }) => stalled === undefined));
      mock.timers.tick(6000);
      const { stalled, loaded, total } = progress.at(-1);
      assert.deepEqual({ stalled, loaded, total }, { stalled: 6000, loaded: layered.length >> 1, total: layered.length });
      stop.abort();
      await assert.rejects(all, { name: 'AbortError' });
      scene.close();
    } finally {
      mock.timers.reset();
    }
  });
});

test('what the documentation shows has types', { skip: npm ? false : 'LEXISPLAT_NPM is not set' }, () => {
  const folder = join(scratch, 'types');
  mkdirSync(join(folder, 'node_modules'), { recursive: true });
  symlinkSync(web, join(folder, 'node_modules/lexisplat'));
  const shown = ['../docs/WEB.md', 'README.md'].map((file) => readFileSync(join(web, file), 'utf8'));
  const examples = shown.flatMap((text) => [...text.matchAll(/```js\n([^]*?)```/g)].map(([, code]) => code));
  const ours = examples.filter((code) => code.includes("from 'lexisplat'") || code.includes('lexi-viewer'));
  assert.ok(ours.length >= 2, `${ours.length} examples`);
  const fields = `import { open, type DenseChunk } from 'lexisplat';
import 'lexisplat/viewer';
const scene = await open('scene.lexi');
for await (const { sh } of scene.chunks({ as: 'dense', refine: true })) console.log(sh.length);
const { codes } = await scene.all();
const { rows }: { rows: Uint8Array } = await scene.all({ as: 'rows' });
const dense: DenseChunk = await scene.all({ as: 'dense' });
console.log(codes.counts.length, rows.length, dense.sh.length);
const viewer = document.querySelector('lexi-viewer');
viewer?.addEventListener('progress', ({ detail }) => console.log(detail.stalled));
// @ts-expect-error codes have no dense SH
(await scene.all({ as: 'codes' })).sh.length;
`;
  [...ours, fields].forEach((code, i) => writeFileSync(join(folder, `example${i}.mts`), code));
  const options = { strict: true, noEmit: true, target: 'es2022', module: 'nodenext', lib: ['es2022', 'dom', 'esnext.asynciterable'], types: [] };
  writeFileSync(join(folder, 'tsconfig.json'), JSON.stringify({ compilerOptions: options, include: ['*.mts'] }));
  const { status, stdout } = spawnSync(process.execPath, [join(npm, 'typescript/bin/tsc'), '-p', folder], { encoding: 'utf8' });
  assert.equal(status, 0, stdout);
});

test('the package has its licences and all that it names', () => {
  const { stdout } = spawnSync('npm', ['pack', '--dry-run', '--json', '--ignore-scripts'], { cwd: web, encoding: 'utf8', shell: process.platform === 'win32' });
  const files = JSON.parse(stdout)[0].files.map(({ path }) => path);
  const { exports } = JSON.parse(readFileSync(join(web, 'package.json'), 'utf8'));
  const named = Object.values(exports).flatMap((entry) => (typeof entry === 'string' ? [entry] : Object.values(entry)));
  for (const path of ['LICENSE-MIT', 'LICENSE-APACHE', 'README.md', ...named.filter((path) => !path.includes('*')).map((path) => path.slice(2))]) {
    assert.ok(files.includes(path), path);
  }
  for (const licence of ['LICENSE-MIT', 'LICENSE-APACHE']) {
    assert.equal(readFileSync(join(web, licence), 'utf8'), readFileSync(join(web, '..', licence), 'utf8'), licence);
  }
});

test('damage is an error, and never a fault', async () => {
  let refused = 0;
  for (let at = 0; at < layered.length; at += 1 + (layered.length >> 7)) {
    const bytes = Uint8Array.from(layered);
    bytes[at] ^= 1 << (at % 8);
    try {
      const scene = await open(bytes, { workers: 0 });
      await scene.all();
      scene.close();
    } catch (error) {
      refused++;
      assert.ok(error instanceof Error && !(error instanceof WebAssembly.RuntimeError), `${at}: ${error}`);
    }
  }
  assert.ok(refused > 100, `${refused} refused`);
  for (const share of [0.001, 0.01, 0.1, 0.5, 0.99]) {
    const cut = layered.subarray(0, Math.floor(layered.length * share));
    await assert.rejects(async () => (await open(cut, { workers: 0 })).all(), /ends|\.lexi/);
  }
});

test('an option that is undefined is not given', async () => {
  const scene = await open(layered, { workers: undefined, memory: undefined, shParts: undefined, signal: undefined });
  assert.ok((await scene.all({ as: 'dense' })).sh.some((value) => value !== 0));
  scene.close();
});

test('a signal stops it', async () => {
  await assert.rejects(open(layered, { signal: AbortSignal.abort() }), { name: 'AbortError' });
  const stop = new AbortController();
  const stall = (_, response, bytes) => response.writeHead(200, { 'content-length': bytes.length }).write(bytes.subarray(0, bytes.length >> 1));
  await served(layered, stall, async (url) => {
    const scene = await open(url, { signal: stop.signal });
    setTimeout(() => stop.abort(), 300);
    await assert.rejects(scene.all(), { name: 'AbortError' });
    scene.close();
  });
});

test('a consumer may leave early', async () => {
  const scene = await open(layered);
  for await (const chunk of scene.chunks({ refine: true })) {
    assert.ok(chunk.count > 0);
    break;
  }
  scene.close();
  scene.close();
});
