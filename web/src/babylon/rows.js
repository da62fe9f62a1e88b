// Gaussians as Babylon's GaussianSplattingMesh.updateData takes them. The layout is that of @babylonjs/core 9.35.0
// (_GetSplat and ConvertPLYWithSHToSplat in gaussianSplattingMeshBase): the 32 bytes of a .splat, and SH of 8 bits.

// Bytes of a row.
const ROW = 32;
// Colour of a base colour's coefficient: 1 / (2 sqrt(pi)), and grey where it is 0.
const SH_C0 = 0.28209479177387814;
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
    this.floats = new Float32Array(this.rows.buffer);
    this.sh = Array.from({ length: Math.ceil(this.rest / TEXEL) }, () => new Uint8ClampedArray(TEXEL * gaussians).fill(SH_ZERO));
  }

  /** @param {import('../index.js').Chunk} chunk as 'dense' */
  write(chunk) {
    const { first, count, positions, scales, rotations, opacities, dc } = chunk;
    for (let i = 0; i < count; i++) {
      const at = first + i;
      for (let k = 0; k < 3; k++) {
        this.floats[(ROW / 4) * at + k] = positions[3 * i + k];
        this.floats[(ROW / 4) * at + 3 + k] = Math.exp(scales[3 * i + k]);
        this.rows[ROW * at + 24 + k] = 255 * (0.5 + SH_C0 * dc[3 * i + k]);
      }
      this.rows[ROW * at + 27] = 255 / (1 + Math.exp(-opacities[i]));
      const length = Math.hypot(rotations[4 * i], rotations[4 * i + 1], rotations[4 * i + 2], rotations[4 * i + 3]);
      for (let k = 0; k < 4; k++) {
        const value = length > 0 ? rotations[4 * i + k] / length : Number(k === 0);
        this.rows[ROW * at + 28 + k] = value * HALF_RANGE + HALF_RANGE;
      }
    }
    this.#writeSh(chunk);
  }

  // Theirs has the three channels of a coefficient beside each other, ours is channel by channel.
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
   * What updateData takes, of the Gaussians that are there.
   * @param {import('../stages.js').Stages} stages
   * @returns {{data: ArrayBuffer, sh: Uint8Array[] | undefined, degree: number}}
   */
  of(stages) {
    const bytes = (array) => new Uint8Array(array.buffer);
    const sh = this.sh.map((texels) => bytes(stages.gathered(texels, TEXEL)));
    return { data: bytes(stages.gathered(this.rows, ROW)), sh: sh.length > 0 ? sh : undefined, degree: this.degree };
  }
}
