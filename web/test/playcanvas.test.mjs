// PlayCanvas from npm, in Chromium, draws a .lexi from codes as it draws the same scene as a PLY.

import assert from 'node:assert/strict';
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { test } from 'node:test';
import { open } from 'lexisplat';
import { psnr } from './support/chromium.mjs';
import { ALIKE, SIZE, assertAlike, dense, golden, picturesOf, setUp } from './support/viewers.mjs';
import { orbit } from './support/views.mjs';

// A half float's relative error is at most 2^-11; values and atoms are half floats, and a few of their products are summed.
const HALVES = 2 ** -8;
// The largest half float.
const MOST = 65504;
const { skip, folder, shown, decompressed, assertExampleDraws } = setUp('playcanvas', 'playcanvas');

for (const [backend, count] of [['webgl2', 2], ['webgpu', 1]]) {
  test(`${backend}: pictures are alike`, { skip }, async () => {
    const { chunk } = await decompressed('packed3_layers');
    const viewer = await shown(backend);
    assert.equal(await viewer.call('backend'), backend);
    const views = orbit(chunk.positions, count, SIZE);
    const theirs = await picturesOf(viewer, views, { url: '/ply/packed3_layers.ply' });
    const ours = await picturesOf(viewer, views, { url: '/golden/packed3_layers.lexi' });
    assert.equal(await viewer.call('gaussians'), chunk.count);
    assertAlike(ours, theirs);
    // The shaders have another branch for escapes.
    await viewer.call('showEscaped', '/golden/packed3_layers.lexi');
    const alike = psnr(await viewer.picture(views[0]), theirs[0]);
    assert.ok(alike >= ALIKE, `as escapes: ${alike} dB`);
    assert.deepEqual(viewer.faults, []);
    if (backend === 'webgpu') await viewer.page.close();
  });
}

// The shaders' computation, step by step in numbers.
function fromTexels({ textures: { lexiCode, lexiNonzeros, lexiAtoms } }, gaussian, coefficients) {
  const sum = new Float64Array(3 * coefficients);
  const count = lexiCode[gaussian] >>> 26;
  const at = lexiCode[gaussian] & 0x3ffffff;
  for (let i = 0; i < coefficients; i++) {
    for (let c = 0; c < 3; c++) {
      if (count === 63) sum[c * coefficients + i] = half(lexiNonzeros[at + 2 * i + (c >> 1)] >>> (16 * (c & 1)));
      else {
        for (let n = at; n < at + count; n++) {
          const atom = lexiNonzeros[n] & 0xffff;
          sum[c * coefficients + i] += half(lexiNonzeros[n] >>> 16) * half(lexiAtoms[4 * (atom * coefficients + i) + c]);
        }
      }
    }
  }
  return sum;
}

function half(bits) {
  const [sign, exponent, fraction] = [bits & 0x8000 ? -1 : 1, (bits >>> 10) & 31, bits & 1023];
  return sign * (exponent === 0 ? fraction / 2 ** 24 : (1 + fraction / 2 ** 10) * 2 ** (exponent - 15));
}

// Of a degree above 3, PlayCanvas draws the first 15 coefficients of a channel.
function assertSame(held, sh, gaussians, name) {
  const rest = sh.length / gaussians;
  const coefficients = Math.min(rest / 3, 15);
  const most = Math.min(MOST, sh.reduce((most, value) => Math.max(most, Math.abs(value)), 0));
  for (let gaussian = 0; gaussian < gaussians; gaussian++) {
    const sum = fromTexels(held, gaussian, coefficients);
    for (let k = 0; k < sum.length; k++) {
      const exact = sh[rest * gaussian + (rest / 3) * Math.floor(k / coefficients) + (k % coefficients)];
      const expected = Math.max(-MOST, Math.min(MOST, exact));
      assert.ok(Math.abs(sum[k] - expected) <= HALVES * most, `${name}, Gaussian ${gaussian}, value ${k}: ${sum[k]}, not ${expected}`);
    }
  }
}

test('on the GPU are a code word and geometry a Gaussian, a word a nonzero, and the dictionary', { skip }, async () => {
  const viewer = await shown('webgl2');
  const scene = await open(readFileSync(join(golden, 'packed3_layers.lexi')), { workers: 0 });
  const { count, codes } = await scene.all({ as: 'codes' });
  scene.close();
  await viewer.call('show', { url: '/golden/packed3_layers.lexi' });
  const geometry = 4 * 4 + 4 * 2 + 4 * 2;
  const atom = ((scene.header.degree + 1) ** 2 - 1) * 4 * 2;
  const needed = (geometry + 4) * count + 4 * codes.indices.length + atom * scene.header.atoms;
  const bytes = await viewer.call('bytes');
  // Textures have whole rows.
  assert.ok(bytes >= needed && bytes < 1.1 * needed, `${bytes}, and ${needed} are needed`);
});

test('codes in textures stand for the SH of every layout, escapes included', { skip }, async () => {
  const viewer = await shown('webgl2');
  const cases = [['f16', 3], ['f32', 3], ['paper', 2], ['degree1_u16_escapes', 1], ['degree4', 3], ['packed3', 3], ['packed3_escapes', 1]];
  for (const [name, bands] of cases) {
    const { chunk } = await dense(name);
    await viewer.call('showAsIs', `/golden/${name}.lexi`);
    const held = await viewer.call('held');
    assert.equal(held.bands, bands);
    assertSame(held, chunk.sh, chunk.count, name);
  }
  await viewer.call('show', { url: '/golden/degree0.lexi' });
  assert.equal((await viewer.call('held')).bands, 0);
  assert.deepEqual(viewer.faults, []);
});

test('a code of too many nonzeros is made dense', { skip }, async () => {
  const viewer = await shown('webgl2');
  // 70 nonzeros of one Gaussian between two others, at degree 1: atom a is a vector of which only value a % 9 is not 0.
  const counts = [1, 70, 2];
  const indices = Array.from({ length: 73 }, (_, n) => n % 9);
  const values = indices.map((_, n) => 0.25 + n / 64);
  const sh = new Float64Array(27);
  let gaussian = 0;
  for (let n = 0, end = 1; n < 73; n++) {
    if (n === end) end += counts[++gaussian];
    sh[9 * gaussian + indices[n]] += values[n] * 0.5;
  }
  const held = await viewer.call('ofCodes', { counts, indices, values, atoms: 9, scale: 0.5 });
  assert.deepEqual([...held.textures.lexiCode].slice(0, 3).map((word) => word >>> 26), [1, 63, 2]);
  assertSame(held, sh, 3, 'made up');
});

test('what is no .lexi is told, and an asset that is unloaded stays so', { skip }, async () => {
  writeFileSync(join(folder, 'wrong.lexi'), 'ply\nformat ascii 1.0\nend_header\n');
  const viewer = await shown('webgl2');
  await assert.rejects(viewer.call('show', { url: '/ply/wrong.lexi' }), /not a .lexi/);
  await assert.rejects(viewer.call('show', { url: '/golden/none.lexi' }), /404/);
  assert.equal(await viewer.call('unloaded', '/golden/packed3_layers.lexi'), null);
  await viewer.call('show', { url: '/golden/packed3_layers.lexi' });
  assert.equal(await viewer.call('gaussians'), 2600);
});

test('the example draws', { skip }, () => assertExampleDraws());
