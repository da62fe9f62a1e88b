// Babylon.js from npm, in Chromium, draws a .lexi by our plugin as it draws the same scene as a PLY by its own.

import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { mkdirSync, statSync, symlinkSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { npm, psnr } from './support/chromium.mjs';
import { ALIKE, SIZE, assertAlike, assertFirstLayerIsDrawn, assertGrowing, dense, golden, picturesOf, setUp } from './support/viewers.mjs';
import { orbit } from './support/views.mjs';

// Babylon draws SH up to this degree.
const MOST_DEGREE = 4;
const TYPED = `import { ImportMeshAsync, RegisterSceneLoaderPlugin } from '@babylonjs/core/Loading/sceneLoader.js';
import { Scene } from '@babylonjs/core/scene.js';
import { LexiFileLoader, registerLexi } from 'lexisplat/babylon';
declare const scene: Scene;
registerLexi({ workers: 1 });
RegisterSceneLoaderPlugin(new LexiFileLoader());
const lexi = { shParts: 1, onRefine: (mesh: { shDegree: number }, there: { gaussians: number }) => console.log(mesh.shDegree, there.gaussians) };
console.log((await ImportMeshAsync('scene.lexi', scene, { pluginOptions: { lexi } })).meshes[0].name);
// @ts-expect-error parts are a number
registerLexi({ shParts: 'all' });
// @ts-expect-error parts are a number
await ImportMeshAsync('scene.lexi', scene, { pluginOptions: { lexi: { shParts: 'all' } } });
`;
const { skip, folder, shown, decompressed, assertExampleDraws } = setUp('babylon', '@babylonjs/core, @babylonjs/loaders', MOST_DEGREE);

const cases = [['WebGL2', 'packed3_layers'], ['WebGL2', 'packed3'], ['WebGL2', 'degree4'], ['WebGPU', 'packed3_layers']];
for (const [backend, name] of cases) {
  test(`${backend}, ${name}: pictures are alike`, { skip }, async () => {
    const { header, chunk } = await decompressed(name);
    const viewer = await shown(backend);
    assert.equal(await viewer.call('backend'), backend);
    const views = orbit(chunk.positions, 2, SIZE);
    const theirs = await picturesOf(viewer, views, { url: `/ply/${name}.ply` });
    const ours = await picturesOf(viewer, views, { url: `/golden/${name}.lexi` });
    assert.equal(await viewer.call('gaussians'), chunk.count);
    assert.equal(await viewer.call('degree'), header.degree);
    assertAlike(ours, theirs);
    await viewer.call('setDegree', 0);
    assert.ok(psnr(await viewer.picture(views[0]), theirs[0]) < ALIKE, 'SH are seen');
    assert.deepEqual(viewer.faults, []);
    if (backend === 'WebGPU') await viewer.page.close();
  });
}

for (const name of ['degree0', 'degree1_u16_escapes', 'paper', 'f16', 'degree4', 'packed3', 'packed3_escapes']) {
  test(`${name}: what updateData gets is what it gets of the PLY`, { skip }, async () => {
    const { chunk } = await decompressed(name);
    const viewer = await shown('WebGL2');
    const theirs = await viewer.call('given', `/ply/${name}.ply`);
    const ours = await viewer.call('given', `/golden/${name}.lexi`);
    assert.equal(ours.data.length, 32 * chunk.count);
    assert.equal(ours.degree ?? 0, theirs.degree ?? 0);
    assert.equal(ours.sh.length, theirs.sh.length);
    for (const [i, expected] of [theirs.data, ...theirs.sh].entries()) {
      const found = [ours.data, ...ours.sh][i];
      assert.equal(found.length, expected.length);
      // Bytes are rounded from numbers of which the last bits may differ, as floats are of scales.
      for (let k = 0; k < found.length; k++) {
        const isScale = i === 0 && k % 32 >= 12 && k % 32 < 24;
        if (!isScale) assert.ok(Math.abs(found[k] - expected[k]) <= 1, `array ${i}, byte ${k}: ${found[k]}, not ${expected[k]}`);
      }
    }
    const scales = ({ data }) => new Float32Array(Uint8Array.from(data).buffer).filter((_, k) => k % 8 >= 3 && k % 8 < 6);
    const expected = scales(theirs);
    scales(ours).forEach((scale, k) => assert.ok(Math.abs(scale / expected[k] - 1) < 1e-6, `scale ${k}`));
  });
}

test('the first layer is drawn while the rest comes', { skip }, async () => assertFirstLayerIsDrawn(await shown('WebGL2')));

test('a mesh shows more and more while its file loads, and in the end what it shows at once', { skip }, async () => {
  const viewer = await shown('WebGL2');
  const { stages, bytes, inScene, same } = await viewer.page.evaluate(async () => {
    const { ImportMeshAsync, scene, rowsOf } = window.viewer;
    const url = '/golden/packed3_layers.lexi';
    const stages = [];
    const bytes = [];
    const meshes = new Set();
    const onRefine = (mesh, there) => {
      stages.push({ ...there, count: mesh.getTotalVertices() });
      meshes.add(mesh);
    };
    const onProgress = ({ loaded, total }) => bytes.push([loaded, total]);
    const { meshes: [refined] } = await ImportMeshAsync(url, scene, { onProgress, pluginOptions: { lexi: { onRefine } } });
    meshes.add(refined);
    const { meshes: [once] } = await ImportMeshAsync(url, scene);
    const same = rowsOf(refined) === rowsOf(once);
    const inScene = [...meshes].map((mesh) => scene.meshes.includes(mesh));
    refined.dispose();
    once.dispose();
    return { stages, bytes, inScene, same };
  });
  assertGrowing(stages);
  for (const { gaussians, of, count } of stages) {
    assert.equal(count, gaussians);
    assert.equal(of, 2600);
  }
  assert.deepEqual(inScene, [true], 'one mesh, which is in the scene');
  assert.ok(same);
  const { size } = statSync(join(golden, 'packed3_layers.lexi'));
  assert.deepEqual(bytes.at(-1), [size, size]);
});

test('files, bytes and containers; what is no .lexi, or was stopped, is told', { skip }, async () => {
  const viewer = await shown('WebGL2');
  const told = await viewer.page.evaluate(async () => {
    const { ImportMeshAsync, LoadAssetContainerAsync, scene } = window.viewer;
    const bytes = await (await fetch('/golden/packed3.lexi')).arrayBuffer();
    const message = (promise) => promise.then(() => 'none', (error) => error.message);
    const count = async (source, options) => {
      const { meshes: [mesh] } = await ImportMeshAsync(source, scene, options);
      const gaussians = mesh.getTotalVertices();
      mesh.dispose();
      return gaussians;
    };
    const before = scene.meshes.length;
    const container = await LoadAssetContainerAsync('/golden/packed3.lexi', scene);
    const apart = scene.meshes.length - before;
    container.addAllToScene();
    const added = scene.meshes.includes(container.meshes[0]);
    container.dispose();
    return {
      file: await count(new File([bytes], 'scene.lexi')),
      bytes: await count(new Uint8Array(bytes), { pluginExtension: '.lexi' }),
      root: await count('packed3.lexi', { rootUrl: '/golden/' }),
      apart,
      added,
      wrong: await message(count('/golden/packed3.ply', { pluginExtension: '.lexi' })),
      missing: await message(count('/golden/none.lexi')),
      stopped: await message(count('/golden/packed3_layers.lexi', { pluginOptions: { lexi: { signal: AbortSignal.abort() } } })),
      left: scene.meshes.length - before,
    };
  });
  assert.deepEqual([told.file, told.bytes, told.root], [300, 300, 300]);
  assert.deepEqual([told.apart, told.added, told.left], [0, true, 0]);
  assert.match(told.wrong, /not a .lexi/);
  assert.match(told.missing, /404/);
  assert.match(told.stopped, /abort/i);
});

test('a scene trained with the anti-aliased dilation is drawn so', { skip }, async () => {
  const viewer = await shown('WebGL2');
  for (const name of ['packed3', 'packed3_layers']) {
    await viewer.call('show', { url: `/golden/${name}.lexi` });
    assert.equal(await viewer.call('compensation'), (await dense(name)).header.antialiased, name);
  }
});

test('calls of Babylon have types', { skip }, () => {
  const modules = join(folder, 'types/node_modules');
  mkdirSync(modules, { recursive: true });
  symlinkSync(join(npm, '@babylonjs'), join(modules, '@babylonjs'));
  symlinkSync(fileURLToPath(new URL('..', import.meta.url)), join(modules, 'lexisplat'));
  writeFileSync(join(folder, 'types/call.mts'), TYPED);
  const options = { strict: true, noEmit: true, target: 'es2022', module: 'nodenext', lib: ['es2022', 'dom', 'esnext.asynciterable'], types: [] };
  const compilerOptions = { ...options, skipLibCheck: true, preserveSymlinks: true };
  writeFileSync(join(folder, 'types/tsconfig.json'), JSON.stringify({ compilerOptions, include: ['*.mts'] }));
  const { status, stdout } = spawnSync(process.execPath, [join(npm, 'typescript/bin/tsc'), '-p', join(folder, 'types')], { encoding: 'utf8' });
  assert.equal(status, 0, stdout);
});

test('the example draws', { skip }, () => assertExampleDraws());
