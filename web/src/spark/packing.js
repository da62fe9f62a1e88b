// Gaussians as Spark packs them. The layout is that of @sparkjsdev/spark 2.2.0: packSplatEncoding in its shader library
// (splatDefines.glsl), and evaluatePackedSH1 to 3 in PackedSplats.

import { half } from '../half.js';
import { SH_C0 } from '../rows.js';

// Ranges of values, as Spark takes those of a PLY (DEFAULT_SPLAT_ENCODING).
const ENCODING = { rgbMin: 0, rgbMax: 1, lnScaleMin: -12, lnScaleMax: 9, sh1Max: 1, sh2Max: 1, sh3Max: 1, lodOpacity: false };
// Gaussians beside each other in a row of a texture, and most rows of one of its layers.
const [WIDTH, MOST_HEIGHT] = [2048, 2048];
// Words of a Gaussian without SH.
const WORDS = 4;
// A logarithm of a scale below this stands for a flat Gaussian (LN_SCALE_ZERO).
const FLAT = -30;
// A byte of a scale is 0 for a flat Gaussian, else 1 to 255.
const SCALE_STEPS = 254;
// The bands: where their coefficients begin in a channel, how many there are, bits of a value, words of a Gaussian. Values
// are signed, of one size to both sides of 0, and lie bit behind bit, coefficient by coefficient.
const BANDS = [
  { name: 'sh1', begin: 0, coefficients: 3, bits: 7, words: 2 },
  { name: 'sh2', begin: 3, coefficients: 5, bits: 8, words: 4 },
  { name: 'sh3', begin: 8, coefficients: 7, bits: 6, words: 4 },
];

// Gaussians of whole textures that have room for so many.
function roomFor(count) {
  const height = Math.max(1, Math.min(MOST_HEIGHT, Math.ceil(count / WIDTH)));
  return WIDTH * height * Math.max(1, Math.ceil(count / (WIDTH * height)));
}

const byte = (value) => Math.max(0, Math.min(255, Math.round(255 * value)));

/** The arrays of a PackedSplats, filled chunk by chunk. Gaussians that are not there yet have opacity 0. */
export class Packing {
  /**
   * @param {number} count Gaussians of the scene
   * @param {number} degree of the SH of its chunks; 0 where SH are left out
   * @param {import('../spark.js').Ranges} [ranges] of values, in place of Spark's own
   */
  constructor(count, degree, ranges) {
    const room = roomFor(count);
    this.encoding = { ...ENCODING, ...ranges, lodOpacity: false };
    this.rest = 3 * ((degree + 1) ** 2 - 1);
    this.bands = BANDS.slice(0, degree);
    this.packedArray = new Uint32Array(WORDS * room);
    this.extra = Object.fromEntries(this.bands.map(({ name, words }) => [name, new Uint32Array(words * room)]));
    /** Names in `extra` that Spark gives the textures of SH. */
    this.textures = this.bands.map(({ name }) => `${name}Texture`);
    /** After how many Gaussians the last that is there ends. */
    this.end = 0;
  }

  /** @param {import('../index.js').Chunk} chunk as 'dense' */
  write(chunk) {
    this.#writeGeometry(chunk);
    for (const band of this.bands) this.#writeBand(band, chunk);
    this.end = Math.max(this.end, chunk.first + chunk.count);
  }

  #writeGeometry({ first, count, positions, scales, rotations, opacities, dc }) {
    const { rgbMin, rgbMax, lnScaleMin, lnScaleMax } = this.encoding;
    const colour = (value) => byte((0.5 + SH_C0 * value - rgbMin) / (rgbMax - rgbMin));
    const steps = SCALE_STEPS / (lnScaleMax - lnScaleMin);
    const scale = (value) => (value < FLAT ? 0 : 1 + Math.max(0, Math.min(SCALE_STEPS, Math.round((value - lnScaleMin) * steps))));
    for (let i = 0; i < count; i++) {
      const to = WORDS * (first + i);
      const turn = turned(rotations, 4 * i);
      const [x, y, z] = [half(positions[3 * i]), half(positions[3 * i + 1]), half(positions[3 * i + 2])];
      const opacity = byte(1 / (1 + Math.exp(-opacities[i])));
      this.packedArray[to] = colour(dc[3 * i]) | (colour(dc[3 * i + 1]) << 8) | (colour(dc[3 * i + 2]) << 16) | (opacity << 24);
      this.packedArray[to + 1] = x | (y << 16);
      this.packedArray[to + 2] = z | ((turn & 0xffff) << 16);
      this.packedArray[to + 3] = scale(scales[3 * i]) | (scale(scales[3 * i + 1]) << 8) | (scale(scales[3 * i + 2]) << 16) | ((turn >> 16) << 24);
    }
  }

  // Spark has the three channels of a coefficient beside each other, a chunk is channel by channel.
  #writeBand({ name, begin, coefficients, bits, words }, { first, count, sh }) {
    const packed = this.extra[name];
    const most = 2 ** (bits - 1) - 1;
    const mask = 2 ** bits - 1;
    const steps = most / this.encoding[`${name}Max`];
    const channel = this.rest / 3;
    packed.fill(0, words * first, words * (first + count));
    for (let i = 0; i < count; i++) {
      const to = words * (first + i);
      let bit = 0;
      for (let k = 0; k < coefficients; k++) {
        for (let c = 0; c < 3; c++, bit += bits) {
          const value = sh[this.rest * i + channel * c + begin + k] * steps;
          const code = Math.max(-most, Math.min(most, Math.round(value))) & mask;
          const [word, shift] = [to + (bit >> 5), bit & 31];
          packed[word] |= code << shift;
          if (shift + bits > 32) packed[word + 1] |= code >>> (32 - shift);
        }
      }
    }
  }
}

// A turn as 24 bits: its axis on an octahedron, 8 bits each, and from bit 16 on its angle from 0 to pi.
function turned(rotations, at) {
  let [w, x, y, z] = [rotations[at], rotations[at + 1], rotations[at + 2], rotations[at + 3]];
  const length = Math.hypot(w, x, y, z);
  const sine = Math.hypot(x, y, z);
  // Without a turn any axis will do.
  if (!(sine > 0)) [x, y, z] = [1, 0, 0];
  else if (w < 0) [x, y, z] = [-x, -y, -z];
  const angle = length > 0 ? 2 * Math.atan2(sine, Math.abs(w)) : 0;
  const sum = Math.abs(x) + Math.abs(y) + Math.abs(z);
  let [u, v] = [x / sum, y / sum];
  // The lower half of the octahedron is folded outwards.
  if (z < 0) [u, v] = [(1 - Math.abs(v)) * (u < 0 ? -1 : 1), (1 - Math.abs(u)) * (v < 0 ? -1 : 1)];
  return byte((u + 1) / 2) | (byte((v + 1) / 2) << 8) | (byte(angle / Math.PI) << 16);
}
