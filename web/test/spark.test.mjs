// Spark from npm, in Chromium, draws a .lexi by our mesh as it draws the same scene as a PLY by its own.

import assert from 'node:assert/strict';
import { statSync } from 'node:fs';
import { join } from 'node:path';
import { beforeEach, test } from 'node:test';
import { psnr } from './support/chromium.mjs';
import { ALIKE, SIZE, assertAlike, assertFirstLayerIsDrawn, assertGrowing, dense, golden, picturesOf, setUp } from './support/viewers.mjs';
import { orbit } from './support/views.mjs';

// Logarithms, angles and roots of two programs differ by this many steps of what is packed.
const STEP = 1;
const { skip, shown, decompressed, assertExampleDraws } = setUp('spark', '@sparkjsdev/spark, three');
let viewer;
beforeEach(async () => {
  if (!skip) viewer = await shown();
});

for (const name of ['packed3_layers', 'packed3']) {
  test(`${name}: pictures are alike`, { skip }, async () => {
    const { chunk } = await decompressed(name);
    const views = orbit(chunk.positions, 2, SIZE);
    const theirs = await picturesOf(viewer, views, { url: `/ply/${name}.ply` });
    const ours = await picturesOf(viewer, views, { url: `/golden/${name}.lexi` });
    assert.equal(await viewer.call('gaussians'), chunk.count);
    assertAlike(ours, theirs);
    assert.deepEqual(viewer.faults, []);
  });
}

for (const name of ['packed3_layers', 'f16', 'degree1_u16_escapes', 'degree4']) {
  test(`${name}: pictures from codes are those of dense SH`, { skip }, async () => {
    const { chunk } = await dense(name);
    const views = orbit(chunk.positions, 2, SIZE);
    // Spark cuts SH off at 1 by itself, which codes are not.
    const most = chunk.sh.reduce((most, value) => Math.max(most, Math.abs(value)), 0);
    const splatEncoding = { sh1Max: most, sh2Max: most, sh3Max: most };
    const theirs = await picturesOf(viewer, views, { url: `/golden/${name}.lexi`, splatEncoding });
    const ours = await picturesOf(viewer, views, { url: `/golden/${name}.lexi`, as: 'codes' });
    assertAlike(ours, theirs);
    await viewer.call('setMaxSh', 0);
    assert.ok(psnr(await viewer.picture(views[1]), ours[1]) < ALIKE, 'SH are seen');
    assert.deepEqual(viewer.faults, []);
  });
}

test('codes of a scene of degree 3 take fewer bytes than dense SH', { skip }, async () => {
  await viewer.call('show', { url: '/golden/packed3.lexi' });
  await viewer.call('draw', orbit(new Float32Array(3), 1, SIZE)[0]);
  const packed = await viewer.call('bytes');
  await viewer.call('show', { url: '/golden/packed3.lexi', as: 'codes' });
  assert.ok((await viewer.call('bytes')) < packed, `less than ${packed} bytes`);
});

// The numbers of a Gaussian's words: halves of places, bytes of colour, opacity and scales, and SH, least bits first.
function numbersOf({ packedArray, ...bands }, i) {
  const [colour, xy, zTurn, scales] = packedArray.slice(4 * i, 4 * i + 4);
  const bytes = (word, count) => Array.from({ length: count }, (_, k) => (word >>> (8 * k)) & 255);
  const numbers = [xy & 0xffff, xy >>> 16, zTurn & 0xffff, ...bytes(colour, 4), ...bytes(scales, 3)];
  for (const [name, bits, count, words] of [['sh1', 7, 9, 2], ['sh2', 8, 15, 4], ['sh3', 6, 21, 4]]) {
    if (!bands[name]) continue;
    const all = bands[name].slice(words * i, words * (i + 1)).reduceRight((sum, word) => (sum << 32n) | BigInt(word), 0n);
    for (let k = 0; k < count; k++) numbers.push(Number(BigInt.asIntN(bits, all >> BigInt(bits * k))));
  }
  return numbers;
}

for (const name of ['degree0', 'degree1_u16_escapes', 'paper', 'f16', 'degree4', 'packed3', 'packed3_escapes']) {
  test(`${name}: what is packed is what Spark packs of the PLY`, { skip }, async () => {
    const { header, chunk } = await decompressed(name);
    await viewer.call('show', { url: `/ply/${name}.ply` });
    const theirs = await viewer.call('held');
    await viewer.call('show', { url: `/golden/${name}.lexi` });
    const ours = await viewer.call('held');
    assert.deepEqual(Object.keys(ours), ['packedArray', 'sh1', 'sh2', 'sh3'].slice(0, 1 + Math.min(3, header.degree)));
    assert.deepEqual(Object.keys(ours), Object.keys(theirs));
    for (let i = 0; i < chunk.count; i++) {
      const expected = numbersOf(theirs, i);
      numbersOf(ours, i).forEach((number, k) => assert.ok(Math.abs(number - expected[k]) <= STEP, `Gaussian ${i}, number ${k}: ${number}, not ${expected[k]}`));
    }
  });
}

for (const as of ['dense', 'codes']) {
  test(`${as}: the first layer is drawn while the rest comes`, { skip }, () => assertFirstLayerIsDrawn(viewer, { as }));
}

test('a mesh shows more and more while its file loads, and in the end what it shows at once', { skip }, async () => {
  const { stages, last, bytes, loaded } = await viewer.page.evaluate(async () => {
    const url = '/golden/packed3_layers.lexi';
    const stages = [];
    const bytes = [];
    const loaded = [];
    const onRefine = (mesh, there) => stages.push({ ...there, shown: mesh.packedSplats.numSplats, whole: mesh.isInitialized });
    const onProgress = (event) => bytes.push([event.loaded, event.total]);
    const words = async (options) => {
      const mesh = new window.viewer.LexiMesh({ url, ...options, onLoad: () => loaded.push(mesh.packedSplats.numSplats) });
      await mesh.initialized;
      return [...mesh.packedSplats.packedArray, ...mesh.packedSplats.extra.sh1].join();
    };
    const refined = await words({ onRefine, onProgress });
    return { stages, bytes, loaded, last: refined === (await words({ refine: false })) };
  });
  assertGrowing(stages);
  for (const { gaussians, of, shown, whole } of stages) {
    assert.ok(shown >= gaussians && gaussians > 0);
    assert.equal(of, 2600);
    assert.equal(whole, false);
  }
  assert.ok(last, 'the same words');
  assert.deepEqual(loaded, [2600, 2600]);
  const { size } = statSync(join(golden, 'packed3_layers.lexi'));
  assert.deepEqual(bytes.at(-1), [size, size]);
});

test('bytes and blobs are taken; what is no .lexi, or was disposed of, is told', { skip }, async () => {
  const told = await viewer.page.evaluate(async () => {
    const { LexiMesh } = window.viewer;
    const bytes = await (await fetch('/golden/packed3.lexi')).arrayBuffer();
    const message = (promise) => promise.then(() => 'none', (error) => `${error.name}: ${error.message}`);
    const count = async (options) => (await new LexiMesh(options).initialized).packedSplats.numSplats;
    const disposed = new LexiMesh({ url: '/golden/packed3_layers.lexi' });
    disposed.dispose();
    const refused = (options) => message((async () => new LexiMesh(options))());
    return {
      counts: [await count({ fileBytes: bytes }), await count({ fileBytes: new Uint8Array(bytes) }), await count({ fileBytes: new Blob([bytes]) })],
      wrong: await message(count({ url: '/golden/packed3.ply' })),
      missing: await message(count({ url: '/golden/none.lexi' })),
      disposed: await message(disposed.initialized),
      nothing: await refused({}),
      form: await refused({ url: '/golden/packed3.lexi', as: 'rows' }),
    };
  });
  assert.deepEqual(told.counts, [300, 300, 300]);
  assert.match(told.wrong, /not a .lexi/);
  assert.match(told.missing, /404/);
  assert.match(told.disposed, /AbortError/);
  assert.match(told.nothing, /url/);
  assert.match(told.form, /dense or codes/);
});

test('the example draws', { skip }, () => assertExampleDraws());
