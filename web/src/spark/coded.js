// A PackedSplats of Spark whose SH stay codes on the GPU: its shader sums a Gaussian's few nonzeros times rows of the
// dictionary. Spark calls fetchSplat when it writes the shader that makes the Gaussians of a view.

import { PackedSplats, dyno } from '@sparkjsdev/spark';
import { DataTexture, HalfFloatType, RGBAFormat, RedIntegerFormat, UnsignedIntType } from 'three';
import { ATOMS_PER_ROW, ESCAPE, ESCAPE_WORDS, OFFSET_BITS, atomTexels, codeWords } from '../codewords.js';

// Spark draws no SH of a higher degree.
const MOST_DEGREE = 3;
// Words beside each other in a row of a texture, as Spark has Gaussians; a power of two.
const WIDTH_BITS = 11;
const WIDTH = 2 ** WIDTH_BITS;

const coefficientsOf = (degree) => (degree + 1) ** 2 - 1;

/** Gaussians of which Spark has geometry and base colours packed as its own. */
export class CodedSplats extends PackedSplats {
  #degree = 0;
  #dictionary;
  #chunks = new Map();
  #words;
  #textures = {};

  /**
   * @param {import('../index.js').Header} header of the scene
   * @param {import('../index.js').Dictionary} dictionary of the scene
   */
  begin(header, dictionary) {
    this.#degree = Math.min(header.degree, MOST_DEGREE);
    this.#dictionary = dictionary;
    if (this.#degree === 0) return;
    const { width, height, texels } = atomTexels(dictionary, coefficientsOf(this.#degree));
    const atoms = new DataTexture(texels, width, height, RGBAFormat, HalfFloatType);
    atoms.needsUpdate = true;
    this.#words = wordsTexture(header.gaussians);
    this.#textures = {
      codes: new dyno.DynoUsampler2D({ key: 'lexiCodes', value: this.#words }),
      nonzeros: new dyno.DynoUsampler2D({ key: 'lexiNonzeros', value: wordsTexture(1) }),
      atoms: new dyno.DynoSampler2D({ key: 'lexiAtoms', value: atoms }),
    };
  }

  /** @param {import('../index.js').Chunk} chunk as 'codes', which replaces an earlier one of its number */
  write(chunk) {
    if (this.#degree === 0) return;
    this.#chunks.set(chunk.index, { first: chunk.first, ...codeWords(chunk, this.#dictionary, coefficientsOf(this.#degree)) });
  }

  /** Gives Spark the codes of all chunks that are there. */
  show() {
    if (this.#degree === 0) return;
    const chunks = [...this.#chunks.values()];
    const total = chunks.reduce((sum, { nonzeros }) => sum + nonzeros.length, 0);
    if (total > 2 ** OFFSET_BITS) throw new RangeError(`${total} nonzeros are too many to be drawn from codes: load the file as 'dense'`);
    const texture = wordsTexture(total);
    let base = 0;
    for (const { first, words, nonzeros } of chunks) {
      // A count lies above where its nonzeros begin, so the sum does not reach it.
      for (let i = 0; i < words.length; i++) this.#words.image.data[first + i] = words[i] + base;
      texture.image.data.set(nonzeros, base);
      base += nonzeros.length;
    }
    this.#words.needsUpdate = true;
    this.#textures.nonzeros.value.dispose();
    this.#textures.nonzeros.value = texture;
  }

  /** Bytes of codes and dictionary on the GPU. */
  get codeBytes() {
    return Object.values(this.#textures).reduce((sum, { value }) => sum + value.image.data.byteLength, 0);
  }

  getNumSh() {
    return this.#degree;
  }

  hasRgbDir() {
    return Math.min(this.#degree, this.maxSh) > 0;
  }

  fetchSplat({ index, viewOrigin }) {
    const gsplat = dyno.readPackedSplat(this.dyno, index);
    if (!viewOrigin || !this.hasRgbDir()) return gsplat;
    const { center, rgb } = dyno.splitGsplat(gsplat).outputs;
    const view = dyno.normalize(dyno.sub(center, viewOrigin));
    const drawn = coefficientsOf(Math.min(this.#degree, this.maxSh));
    const summed = new dyno.Dyno({
      inTypes: { index: 'int', view: 'vec3', codes: 'usampler2D', nonzeros: 'usampler2D', atoms: 'sampler2D' },
      outTypes: { rgb: 'vec3' },
      inputs: { index, view, ...this.#textures },
      globals: () => [shaderOf(drawn, coefficientsOf(this.#degree))],
      statements: ({ inputs, outputs }) => [
        `${outputs.rgb} = lexiColour${drawn}(${[inputs.index, inputs.view, inputs.codes, inputs.nonzeros, inputs.atoms].join(', ')});`,
      ],
    });
    return dyno.combineGsplat({ gsplat, rgb: dyno.add(rgb, summed.outputs.rgb) });
  }

  dispose() {
    for (const { value } of Object.values(this.#textures)) value.dispose();
    this.#chunks.clear();
    super.dispose();
  }
}

function wordsTexture(count) {
  const height = Math.max(1, Math.ceil(count / WIDTH));
  const texture = new DataTexture(new Uint32Array(WIDTH * height), WIDTH, height, RedIntegerFormat, UnsignedIntType);
  texture.internalFormat = 'R32UI';
  texture.needsUpdate = true;
  return texture;
}

// The real spherical harmonics that the 3DGS trainer uses, degree by degree, with its signs.
const BASIS = `
  float xx = v.x * v.x, yy = v.y * v.y, zz = v.z * v.z;
  float basis[15] = float[15](
    -0.4886025119 * v.y, 0.4886025119 * v.z, -0.4886025119 * v.x,
    1.0925484306 * v.x * v.y, -1.0925484306 * v.y * v.z, 0.3153915652 * (2.0 * zz - xx - yy),
    -1.0925484306 * v.x * v.z, 0.5462742153 * (xx - yy),
    -0.5900435899 * v.y * (3.0 * xx - yy), 2.8906114426 * v.x * v.y * v.z, -0.4570457995 * v.y * (4.0 * zz - xx - yy),
    0.3731763326 * v.z * (2.0 * zz - 3.0 * xx - 3.0 * yy), -0.4570457995 * v.x * (4.0 * zz - xx - yy),
    1.4453057213 * v.z * (xx - yy), -0.5900435899 * v.x * (xx - 3.0 * yy));`;

// The colour that SH add to a Gaussian's base colour; `drawn` coefficients of a channel are summed of those that `held` are.
function shaderOf(drawn, held) {
  // Written out, since a basis that is read by a number that the compiler knows stays in registers.
  const term = (_, i) => `basis[${i}] * texelFetch(atoms, row + ivec2(${i}, 0), 0).xyz`;
  const terms = Array.from({ length: drawn }, term).join(' + ');
  const texel = (at) => `ivec2(${at} & ${WIDTH - 1}u, ${at} >> ${WIDTH_BITS}u)`;
  return `
vec3 lexiColour${drawn}(int index, vec3 v, usampler2D codes, usampler2D nonzeros, sampler2D atoms) {${BASIS}
  uint code = texelFetch(codes, ${texel('uint(index)')}, 0).x;
  uint at = code & ${2 ** OFFSET_BITS - 1}u;
  uint count = code >> ${OFFSET_BITS}u;
  vec3 sum = vec3(0.0);
  if (count == ${ESCAPE}u) {
    for (int i = 0; i < ${drawn}; i++) {
      uint word = at + uint(i) * ${ESCAPE_WORDS}u;
      vec2 rg = unpackHalf2x16(texelFetch(nonzeros, ${texel('word')}, 0).x);
      sum += basis[i] * vec3(rg, unpackHalf2x16(texelFetch(nonzeros, ${texel('(word + 1u)')}, 0).x).x);
    }
    return sum;
  }
  for (uint n = at; n < at + count; n++) {
    uint nonzero = texelFetch(nonzeros, ${texel('n')}, 0).x;
    int atom = int(nonzero & 0xffffu);
    ivec2 row = ivec2((atom % ${ATOMS_PER_ROW}) * ${held}, atom / ${ATOMS_PER_ROW});
    vec3 shown = ${terms};
    sum += unpackHalf2x16(nonzero).y * shown;
  }
  return sum;
}`;
}
