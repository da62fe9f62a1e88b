// three.js from npm, in Chromium, draws a .lexi by our loader as it draws the same scene as a PLY by its own.

import assert from 'node:assert/strict';
import { statSync } from 'node:fs';
import { join } from 'node:path';
import { test } from 'node:test';
import { SIZE, assertAlike, assertGrowing, golden, picturesOf, setUp } from './support/viewers.mjs';
import { orbit } from './support/views.mjs';

const { skip, shown, decompressed, assertExampleDraws } = setUp('three', 'three');

for (const backend of ['WebGPU', 'WebGL2']) {
  test(`${backend}: pictures are alike`, { skip }, async () => {
    const { chunk } = await decompressed('packed3_layers');
    const viewer = await shown(backend);
    assert.equal(await viewer.call('backend'), backend);
    const views = orbit(chunk.positions, 2, SIZE);
    const theirs = await picturesOf(viewer, views, { url: '/ply/packed3_layers.ply' });
    const ours = await picturesOf(viewer, views, { url: '/golden/packed3_layers.lexi' });
    assert.equal(await viewer.call('gaussians'), chunk.count);
    assertAlike(ours, theirs);
    assert.deepEqual(viewer.faults, []);
  });
}

test('a PLY that the Rust program wrote gives the same Gaussians', { skip }, async () => {
  const viewer = await shown('WebGPU');
  const [ours, theirs] = await viewer.page.evaluate(async () => {
    const gaussians = async (loader, url) => {
      const geometry = await new loader().loadAsync(url);
      const names = ['position', 'covariance', 'color', 'sphericalHarmonics1', 'sphericalHarmonics2', 'sphericalHarmonics3'];
      const columns = names.map((name) => geometry.getAttribute(name));
      // The program keeps the order of the source, the loader that of the file.
      const rows = Array.from({ length: columns[0].count }, (_, i) =>
        columns.flatMap(({ array, itemSize }) => [...array.slice(itemSize * i, itemSize * (i + 1))]),
      );
      return rows.sort((a, b) => a[0] - b[0] || a[1] - b[1] || a[2] - b[2]);
    };
    const { LexiLoader, GaussianSplatPLYLoader } = window.viewer;
    return [await gaussians(LexiLoader, '/golden/packed3.lexi'), await gaussians(GaussianSplatPLYLoader, '/golden/packed3.ply')];
  });
  assert.equal(ours.length, 300);
  assert.deepEqual(ours, theirs);
});

for (const name of ['degree0', 'degree1_u16_escapes', 'paper', 'f16', 'degree4']) {
  test(`${name}: attributes are those of the PLY`, { skip }, async () => {
    await decompressed(name);
    const viewer = await shown('WebGPU');
    const [ours, theirs] = await viewer.page.evaluate(async (name) => {
      const { LexiLoader, GaussianSplatPLYLoader } = window.viewer;
      const arrays = (geometry) => Object.fromEntries(Object.entries(geometry.attributes).map(([key, { array }]) => [key, [...array]]));
      const ours = await new LexiLoader().loadAsync(`/golden/${name}.lexi`);
      return [arrays(ours), arrays(await new GaussianSplatPLYLoader().loadAsync(`/ply/${name}.ply`))];
    }, name);
    assert.deepEqual(ours, theirs);
  });
}

test('geometries come while a file loads, and the last is that of a file loaded at once', { skip }, async () => {
  const viewer = await shown('WebGPU');
  const { stages, same, count, bytes } = await viewer.page.evaluate(async () => {
    const { LexiLoader } = window.viewer;
    const url = '/golden/packed3_layers.lexi';
    const stages = [];
    const bytes = [];
    const loader = new LexiLoader().setRefine((geometry, there) =>
      stages.push({ ...there, count: geometry.getAttribute('position').count, radius: geometry.boundingSphere.radius }),
    );
    const last = await loader.loadAsync(url, ({ loaded, total }) => bytes.push([loaded, total]));
    const once = await new LexiLoader().loadAsync(url);
    const same = Object.entries(once.attributes).every(([name, { array }]) => array.every((value, i) => value === last.attributes[name].array[i]));
    return { stages, same, count: last.getAttribute('position').count, bytes };
  });
  assertGrowing(stages);
  for (const stage of stages) {
    assert.equal(stage.count, stage.gaussians);
    assert.equal(stage.of, count);
    assert.ok(stage.radius > 0);
  }
  assert.ok(same);
  const { size } = statSync(join(golden, 'packed3_layers.lexi'));
  assert.deepEqual(bytes.at(-1), [size, size]);
});

test('bytes and blobs are parsed; what is no .lexi, or ended, is told', { skip }, async () => {
  const viewer = await shown('WebGPU');
  const told = await viewer.page.evaluate(async () => {
    const { LexiLoader, THREE } = window.viewer;
    const bytes = await (await fetch('/golden/packed3.lexi')).arrayBuffer();
    const message = (promise) => promise.then(() => 'none', (error) => `${error.name}: ${error.message}`);
    const items = [];
    const manager = new THREE.LoadingManager(undefined, undefined, (url) => items.push(url));
    const ended = new LexiLoader(manager);
    const loading = message(ended.loadAsync('/golden/packed3_layers.lexi'));
    ended.abort();
    return {
      blob: (await new LexiLoader().parse(new Blob([bytes]))).getAttribute('position').count,
      bytes: (await new LexiLoader().parse(bytes)).getAttribute('position').count,
      wrong: await message(new LexiLoader(manager).loadAsync('/golden/packed3.ply')),
      missing: await message(new LexiLoader(manager).setPath('/golden/').loadAsync('none.lexi')),
      ended: await loading,
      again: (await ended.loadAsync('/golden/packed3.lexi')).getAttribute('position').count,
      items: items.sort(),
    };
  });
  assert.equal(told.blob, 300);
  assert.equal(told.bytes, 300);
  assert.match(told.wrong, /not a .lexi/);
  assert.match(told.missing, /404/);
  assert.match(told.ended, /AbortError/);
  assert.equal(told.again, 300);
  assert.deepEqual(told.items, ['/golden/packed3.ply', '/golden/packed3_layers.lexi', 'none.lexi']);
});

test('the example draws', { skip }, () => assertExampleDraws());
