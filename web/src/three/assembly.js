// The arrays that three.js' GaussianSplat is made of, filled chunk by chunk.

import {
  SH_BAND_COMPONENTS,
  SH_BAND_WORDS,
  createGaussianSplatGeometry,
  createPackedSphericalHarmonicsBand,
  sigmoid,
  writeColorBytesFromSH0,
  writeCovariance,
} from 'three/addons/utils/GaussianSplatUtils.js';
import { Stages } from '../stages.js';

// three.js draws no SH of a higher degree.
const MOST_DEGREE = 3;
// A byte b of an SH coefficient stands for (b - 128) / 128, says createGaussianSplatGeometry.
const SH_BYTE_ZERO = 128;
const BYTES_PER_WORD = 4;

/**
 * A scene of which some chunks are there. Each part of it is written once by each chunk that has it, so a finer chunk
 * replaces a coarser one.
 */
export class Assembly {
  /** @param {import('../index.js').Header} header of the scene */
  constructor(header) {
    const count = header.gaussians;
    this.degree = Math.min(header.degree, MOST_DEGREE);
    this.rest = 3 * ((header.degree + 1) ** 2 - 1);
    this.centers = new Float32Array(3 * count);
    this.covariances = new Float32Array(6 * count);
    this.colors = new Uint8ClampedArray(4 * count);
    this.bands = Array.from({ length: this.degree }, (_, band) => createPackedSphericalHarmonicsBand(count, band + 1));
    /** The stages that are there. */
    this.stages = new Stages(count);
  }

  /** @param {import('../index.js').Chunk} chunk as 'dense' */
  write(chunk) {
    const { first, count, positions, scales, rotations, opacities, dc } = chunk;
    this.centers.set(positions, 3 * first);
    for (let i = 0; i < count; i++) {
      const [s, r, at] = [3 * i, 4 * i, first + i];
      const deviations = [Math.exp(scales[s]), Math.exp(scales[s + 1]), Math.exp(scales[s + 2])];
      // Ours begins with w, theirs ends with it.
      writeCovariance(this.covariances, 6 * at, ...deviations, rotations[r + 1], rotations[r + 2], rotations[r + 3], rotations[r]);
      writeColorBytesFromSH0(this.colors, 4 * at, dc[s], dc[s + 1], dc[s + 2], sigmoid(opacities[i]));
    }
    for (let band = 1; band <= this.degree; band++) this.#writeBand(band, chunk);
    this.stages.note(chunk);
  }

  // Theirs is coefficient by coefficient with its three channels beside each other, ours channel by channel.
  #writeBand(band, { first, count, sh }) {
    const { bytes } = this.bands[band - 1];
    const stride = SH_BAND_WORDS[band] * BYTES_PER_WORD;
    const begin = band ** 2 - 1;
    const channel = this.rest / 3;
    for (let i = 0; i < count; i++) {
      const [from, to] = [this.rest * i + begin, stride * (first + i)];
      for (let j = 0; j < SH_BAND_COMPONENTS[band]; j++) {
        const coefficient = Math.floor(j / 3);
        bytes[to + j] = sh[from + coefficient + channel * (j % 3)] * SH_BYTE_ZERO + SH_BYTE_ZERO;
      }
    }
  }

  /**
   * A geometry of the Gaussians that are there. Once all are as fine as they come, it has the arrays themselves; before, copies.
   * @returns {import('three').BufferGeometry}
   */
  geometry() {
    const { complete } = this.stages;
    const of = (array, size) => {
      const gathered = this.stages.gathered(array, size);
      return gathered === array && !complete ? array.slice() : gathered;
    };
    const harmonics = {};
    this.bands.forEach(({ packed }, i) => (harmonics[`sh${i + 1}`] = of(packed, SH_BAND_WORDS[i + 1])));
    return createGaussianSplatGeometry(of(this.centers, 3), of(this.covariances, 6), of(this.colors, 4), harmonics);
  }
}
