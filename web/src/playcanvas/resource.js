// A scene of ours as a resource of PlayCanvas: textures of geometry and codes, and the shader code that reads them.

import {
  FloatPacking,
  GSplatData,
  GSplatFormat,
  GSplatResourceBase,
  PIXELFORMAT_R32U,
  PIXELFORMAT_RGBA16F,
  PIXELFORMAT_RGBA32U,
  Texture,
  TextureUtils,
  Vec2,
} from 'playcanvas';
import { atomTexels, codeWords } from '../codewords.js';
import { SH_C0 } from '../rows.js';
import { GLSL, WGSL } from './shaders.js';

const half = FloatPacking.float2Half;
// PlayCanvas draws no SH of a higher degree.
const MOST_DEGREE = 3;
// Bounds of a Gaussian in standard deviations, as PlayCanvas takes them.
const BOUND = 2;

/** The resource that an entity's gsplat component draws. SH stay codes on the GPU. */
export class LexiResource extends GSplatResourceBase {
  /**
   * @param {import('playcanvas').GraphicsDevice} device
   * @param {import('../index.js').Scene['header']} header
   * @param {import('../index.js').Scene['dictionary']} dictionary
   * @param {import('../index.js').Chunk} chunk all of the scene, as 'codes'
   * @param {{prepareCenters?: boolean, reorder?: boolean}} [options] prepareCenters: false where the engine sorts on the
   *     GPU; reorder: false leaves Gaussians in the order of the file, layer by layer
   */
  constructor(device, header, dictionary, chunk, options = {}) {
    const degree = Math.min(header.degree, MOST_DEGREE);
    const order = orderOf(chunk, options.reorder ?? true);
    super(device, dataOf(chunk, degree, order), options);
    const count = chunk.count;
    const { placed, shape, color } = geometryTexels(chunk, order);
    const formats = [this.#texture('lexiPlaced', PIXELFORMAT_RGBA32U, count, placed)];
    formats.push(this.#texture('lexiShape', PIXELFORMAT_RGBA16F, count, shape));
    formats.push(this.#texture('lexiColor', PIXELFORMAT_RGBA16F, count, color));
    if (degree > 0) {
      const kept = (degree + 1) ** 2 - 1;
      const { words, nonzeros } = codeWords(chunk, dictionary, kept, order);
      const atoms = atomTexels(dictionary, kept);
      formats.push(this.#texture('lexiCode', PIXELFORMAT_R32U, count, words));
      formats.push(this.#texture('lexiNonzeros', PIXELFORMAT_R32U, Math.max(1, nonzeros.length), nonzeros));
      formats.push(this.#texture('lexiAtoms', PIXELFORMAT_RGBA16F, 0, atoms.texels, atoms));
    }
    TextureUtils.calcTextureSize(count, this.streams.textureDimensions);
    this._format = new GSplatFormat(device, formats, { readGLSL: GLSL, readWGSL: WGSL });
  }

  // Texels in the order of their numbers, or of a given width and height.
  #texture(name, format, count, texels, size) {
    const { x: width, y: height } = size ? { x: size.width, y: size.height } : TextureUtils.calcTextureSize(count, new Vec2());
    const channels = format === PIXELFORMAT_R32U ? 1 : 4;
    const level = new texels.constructor(width * height * channels);
    level.set(texels);
    this.streams.textures.set(name, Texture.createDataTexture2D(this.device, name, width, height, format, [level]));
    return { name, format };
  }

  /** Bytes of the textures on the GPU. */
  get bytes() {
    let sum = 0;
    for (const texture of this.streams.textures.values()) sum += texture.gpuSize;
    return sum;
  }

  /** @param {Map<string, unknown>} defines of the shader */
  configureMaterialDefines(defines) {
    defines.set('SH_BANDS', this.gsplatData.shBands);
  }

  /** The shader code leaves geometry out where the engine has it. */
  get supportsWorkBufferGeometry() {
    return true;
  }
}

// The Gaussian of each texel. Neighbours are beside each other, as the engine puts those of a PLY: textures are read faster,
// and Gaussians that its sort cannot tell apart are drawn in the same order.
function orderOf({ count, positions }, reorder) {
  if (!reorder || count === 0) return Uint32Array.from({ length: count }, (_, i) => i);
  const column = (name, k) => ({ name, type: 'float', byteSize: 4, storage: Float32Array.from({ length: count }, (_, i) => positions[3 * i + k]) });
  return new GSplatData([{ name: 'vertex', count, properties: ['x', 'y', 'z'].map(column) }]).calcMortonOrder();
}

// The methods of a scene's data that GSplatResourceBase calls.
function dataOf({ count, positions, scales }, shBands, order) {
  const getCenters = () => {
    const centers = new Float32Array(3 * count);
    order.forEach((i, index) => centers.set(positions.subarray(3 * i, 3 * i + 3), 3 * index));
    return centers;
  };
  const calcAabb = (box) => {
    const [least, most] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
    for (let i = 0; i < count; i++) {
      const reach = BOUND * Math.exp(Math.max(scales[3 * i], scales[3 * i + 1], scales[3 * i + 2]));
      for (let k = 0; k < 3; k++) {
        const at = positions[3 * i + k];
        if (!Number.isFinite(at + reach)) continue;
        least[k] = Math.min(least[k], at - reach);
        most[k] = Math.max(most[k], at + reach);
      }
    }
    if (least.every((low, k) => low <= most[k])) {
      box.center.set(...least.map((low, k) => (low + most[k]) / 2));
      box.halfExtents.set(...least.map((low, k) => (most[k] - low) / 2));
    }
  };
  return { numSplats: count, shBands, getCenters, calcAabb };
}

// Positions are whole floats; turns, sizes and colours are half floats, as in the engine's own resource of a PLY.
function geometryTexels({ count, positions, scales, rotations, opacities, dc }, order) {
  const placed = new Uint32Array(4 * count);
  const positionsOut = new Float32Array(placed.buffer);
  const shape = new Uint16Array(4 * count);
  const color = new Uint16Array(4 * count);
  order.forEach((i, index) => {
    const [w, x, y, z] = unit(rotations, 4 * i);
    const to = 4 * index;
    for (let k = 0; k < 3; k++) {
      positionsOut[to + k] = positions[3 * i + k];
      shape[to + k] = half(Math.exp(scales[3 * i + k]));
      color[to + k] = half(0.5 + SH_C0 * dc[3 * i + k]);
    }
    // w is what is missing from the length 1, so it must not be negative.
    const sign = w < 0 ? -1 : 1;
    placed[to + 3] = half(sign * x) | (half(sign * y) << 16);
    shape[to + 3] = half(sign * z);
    color[to + 3] = half(1 / (1 + Math.exp(-opacities[i])));
  });
  return { placed, shape, color };
}

function unit(rotations, at) {
  const q = rotations.subarray(at, at + 4);
  const length = Math.hypot(...q);
  return length > 0 ? q.map((value) => value / length) : [1, 0, 0, 0];
}
