// Gaussians as Babylon's GaussianSplattingMesh.updateData takes them. The layout is that of @babylonjs/core 9.35.0
// (_GetSplat and ConvertPLYWithSHToSplat in gaussianSplattingMeshBase): the 32 bytes of a .splat, and SH of 8 bits.

import { ROW, writeRows } from '../rows.js';

// A byte b of a turn or of SH stands for b / 127.5 - 1.
const HALF_RANGE = 127.5;
// The byte of no SH.
const SH_ZERO = 128;
// A texel of SH has 16 bytes; values that need more lie in further textures.
const TEXEL = 16;

/** A scene's rows and SH, filled chunk by chunk. */
export class Rows {
  /** @param {import('../index.js').Header} header of the scene */
  constructor({ gaussians, degree }) {
    this.degree = degree;
    this.rest = 3 * ((degree + 1) ** 2 - 1);
    this.rows = new Uint8ClampedArray(ROW * gaussians);
    this.sh = Array.from({ length: Math.ceil(this.rest / TEXEL) }, () => new Uint8ClampedArray(TEXEL * gaussians).fill(SH_ZERO));
  }

  /** @param {import('../index.js').Chunk} chunk as 'dense' */
  write(chunk) {
    writeRows(this.rows, chunk.first, chunk, HALF_RANGE);
    this.#writeSh(chunk);
  }

  // Babylon has the three channels of a coefficient beside each other, a chunk is channel by channel.
  #writeSh({ first, count, sh }) {
    const channel = this.rest / 3;
    for (let i = 0; i < count; i++) {
      for (let k = 0, j = 0; k < channel; k++) {
        for (let c = 0; c < 3; c++, j++) {
          const value = sh[this.rest * i + channel * c + k];
          this.sh[Math.floor(j / TEXEL)][TEXEL * (first + i) + (j % TEXEL)] = value * HALF_RANGE + HALF_RANGE;
        }
      }
    }
  }

  /**
   * The arguments of updateData, of the Gaussians that are there.
   * @param {import('../stages.js').Stages} stages
   * @returns {{data: ArrayBuffer, sh: Uint8Array[] | undefined, degree: number}}
   */
  of(stages) {
    const bytes = (array) => new Uint8Array(array.buffer);
    const sh = this.sh.map((texels) => bytes(stages.gathered(texels, TEXEL)));
    return { data: bytes(stages.gathered(this.rows, ROW)), sh: sh.length > 0 ? sh : undefined, degree: this.degree };
  }
}
