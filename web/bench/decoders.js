// The page of decoders.mjs: decoders of several packages, from a file's bytes in memory to arrays or a viewer's resource.

import { open } from 'lexisplat';
import * as wasm from '../wasm/decoder.js';

// Parts of SH-rest that the decoder takes, and bytes of a file that it holds: all.
const ALL = 0xffffffff;
// SH-rest values of a Gaussian at degree 3.
const REST = 45;

const files = {};

// Makes the parts of a package that are made once, before anything is timed.
const once = (make) => {
  let made;
  return () => (made ??= make());
};
const ours = once(async () => wasm.initSync({ module: await WebAssembly.compileStreaming(fetch('../wasm/decoder_bg.wasm')) }));
const adobe = once(async () => (await import('@adobe/spz')).default());
const loader = once(() => import('@spz-loader/core'));
const spark = once(async () => {
  const module = await import('@sparkjsdev/spark');
  await module.alone.ready;
  return module;
});
const playcanvas = once(async () => {
  const pc = await import('playcanvas');
  const { addLexiParser } = await import('lexisplat/playcanvas');
  const canvas = document.createElement('canvas');
  const options = new pc.AppOptions();
  options.graphicsDevice = await pc.createGraphicsDevice(canvas, { deviceTypes: ['webgl2'], antialias: false });
  options.componentSystems = [pc.CameraComponentSystem, pc.GSplatComponentSystem];
  options.resourceHandlers = [pc.GSplatHandler, pc.TextureHandler];
  const app = new pc.AppBase(canvas);
  app.init(options);
  addLexiParser(app);
  return { pc, app };
});

/**
 * The decoders. Each takes bytes, its options, and a clock that it may start anew once what it only needs for its input is
 * made. It gives how many Gaussians it decoded, how many SH-rest values, and how its result is freed after the time is taken.
 */
const decoders = {
  // The WebAssembly of this package, called by itself.
  async alone(bytes, { as }, clock) {
    await ours();
    clock.start();
    const feed = new wasm.Feed('scene.lexi', ALL, ALL);
    for (let wanted = feed.wants(); wanted; wanted = feed.wants()) feed.feed(wanted[0], bytes.subarray(wanted[0], wanted[1]));
    const decoder = new wasm.Decoder('scene.lexi', feed.start(), ALL);
    const kept = [];
    const found = { gaussians: 0, sh: 0 };
    for (let index = feed.next(false, false); index !== undefined; index = feed.next(false, false)) {
      const chunk = decoder.decode(feed.job(index, false));
      const rest = as === 'dense' ? [chunk.dense()] : [chunk.counts(), chunk.narrow_indices() ?? chunk.wide_indices(), chunk.half_values() ?? chunk.full_values()];
      kept.push(chunk.positions(), chunk.scales(), chunk.rotations(), chunk.opacities(), chunk.dc(), ...rest);
      if (as !== 'dense') kept.push(chunk.escapes(), chunk.escape_rows());
      else found.sh += rest[0].length;
      found.gaussians += chunk.count;
      chunk.free();
    }
    decoder.free();
    feed.free();
    return { ...found, kept };
  },

  // This package's `open` and `all`; with isStarted, what `open` does (workers, header, dictionary) is not timed.
  async open(bytes, { as, workers, isStarted }, clock) {
    const scene = await open(bytes, { workers });
    if (isStarted) clock.start();
    const chunk = await scene.all({ as });
    return { gaussians: chunk.count, sh: chunk.sh?.length, kept: chunk, free: () => scene.close() };
  },

  // SPZ's own library.
  async adobe(bytes, _, clock) {
    const spz = await adobe();
    clock.start();
    const cloud = spz.loadSpzFromBuffer(bytes, { to: spz.CoordinateSystem.UNSPECIFIED });
    return { gaussians: cloud.numPoints, sh: cloud.sh.length, kept: cloud };
  },

  // The same by its call that gives pieces, which are copied to arrays.
  async adobePieces(bytes, _, clock) {
    const spz = await adobe();
    clock.start();
    const at = spz._malloc(bytes.length);
    spz.HEAPU8.set(bytes, at);
    const arrays = [];
    let widths;
    const found = {};
    spz.loadSpzStreaming(at, bytes.length, { to: spz.CoordinateSystem.UNSPECIFIED }, {
      onHeader({ numPoints, shDegree }) {
        found.gaussians = numPoints;
        widths = [3, 1, 3, 3, 4, 3 * ((shDegree + 1) ** 2 - 1)];
        for (const width of widths) arrays.push(new Float32Array(width * numPoints));
      },
      onChunk: (attribute, first, data) => arrays[attribute].set(data, first * widths[attribute]),
      onError: (message) => (found.error = message),
    });
    spz._free(at);
    if (found.error) throw new Error(found.error);
    return { ...found, sh: arrays.at(-1).length, kept: arrays };
  },

  // An older build of it, whose one call makes the WebAssembly each time.
  async loader(bytes, _, clock) {
    const { loadSpz } = await loader();
    clock.start();
    const cloud = await loadSpz(bytes);
    return { gaussians: cloud.numPoints, sh: cloud.sh.length, kept: cloud };
  },

  // Spark's WebAssembly, called by itself.
  async sparkAlone(bytes, _, clock) {
    const { alone } = await spark();
    clock.start();
    const decoded = alone.packed(bytes, 'spz');
    return { gaussians: decoded.numSplats, isWhole: Boolean(decoded.sh3), kept: decoded };
  },

  // Spark's public call, which decodes in one of its workers; these live on.
  async spark(bytes, _, clock) {
    const { PackedSplats } = await spark();
    clock.start();
    const splats = await new PackedSplats({ fileBytes: bytes, fileType: 'spz' }).initialized;
    return { gaussians: splats.numSplats, isWhole: Boolean(splats.extra.sh3), kept: splats, free: () => splats.dispose() };
  },

  // PlayCanvas, until a resource is there, or with isFloats until its data are floats.
  async playcanvas(bytes, { ext, isFloats }, clock) {
    const { pc, app } = await playcanvas();
    const name = `scene-${crypto.randomUUID()}.${ext}`;
    const contents = ext === 'ply' ? new Response(bytes) : bytes.slice().buffer;
    const asset = new pc.Asset(name, 'gsplat', { url: `/${name}`, filename: name, contents });
    app.assets.add(asset);
    clock.start();
    const resource = new Promise((resolve, reject) => {
      asset.once('load', () => resolve(asset.resource));
      asset.once('error', (error) => reject(error instanceof Error ? error : new Error(error)));
    });
    const early = isFloats && ext === 'ply' && new Promise((resolve) => asset.once('load:data', (data) => resolve(data.decompress())));
    app.assets.load(asset);
    const floats = await (early || (isFloats ? resource.then(({ gsplatData }) => gsplatData.decompress()) : undefined));
    if (floats) clock.stop();
    const { gsplatData, streams } = await resource;
    const free = () => {
      asset.unload();
      app.assets.remove(asset);
    };
    const bytesOnGpu = [...streams.textures.values()].reduce((sum, texture) => sum + texture.gpuSize, 0);
    return { gaussians: gsplatData.numSplats, isWhole: gsplatData.shBands === 3, gpu: bytesOnGpu, kept: floats, free };
  },
};

/** Fetches files, whose addresses are given by names. */
async function prepare(addresses) {
  for (const [name, address] of Object.entries(addresses)) files[name] = new Uint8Array(await (await fetch(address)).arrayBuffer());
}

/**
 * Decodes once.
 * @returns {Promise<{ms: number, gaussians: number, gpu?: number} | {error: string}>} gpu: bytes of a resource's textures
 */
async function time(name, file, options = {}) {
  globalThis.gc?.();
  const clock = {
    start: () => (clock.from = performance.now()),
    stop: () => (clock.to = performance.now()),
  };
  try {
    clock.start();
    const { gaussians, sh, isWhole = true, gpu, free } = await decoders[name](files[file], options, clock);
    if (clock.to === undefined) clock.stop();
    free?.();
    if (!(gaussians > 0)) throw new Error('it decoded nothing');
    if (!isWhole || (options.as !== 'codes' && sh !== undefined && sh !== REST * gaussians)) throw new Error('it gave no SH of degree 3');
    return { ms: clock.to - clock.from, gaussians, gpu };
  } catch (error) {
    return { error: String(error?.message ?? error) };
  }
}

/** Bytes of Spark's textures of an SPZ: its packed splats and their SH. */
async function sparkOnGpu(file) {
  const { PackedSplats } = await spark();
  const splats = await new PackedSplats({ fileBytes: files[file], fileType: 'spz' }).initialized;
  const textures = [splats.getTexture(), ...Object.values(splats.ensureShTextures()).map(({ value }) => value)];
  return textures.reduce((sum, { image }) => sum + image.data.byteLength, 0);
}

window.bench = { prepare, time, sparkOnGpu };
document.title = 'ready';
