/** Rows of 32 bytes, as in a .splat file: position, scales, colour and opacity, rotation. */

/** Bytes of a row. */
export const ROW = 32;
/** Colour is 0.5 + SH_C0 times the SH coefficient of degree 0; this is 1 / (2 sqrt(pi)). */
export const SH_C0 = 0.28209479177387814;
/** A byte b of a rotation stands for b / 128 - 1. */
const ROTATION_ZERO = 128;

/**
 * The rows of a chunk. SH-rest, and scales and colours beyond what 8 bits hold, are lost.
 *
 * @param {{count: number, positions: Float32Array, scales: Float32Array, rotations: Float32Array, opacities: Float32Array, dc: Float32Array}} chunk
 * @returns {Uint8Array}
 */
export function rowsOf(chunk) {
  const rows = new Uint8ClampedArray(ROW * chunk.count);
  writeRows(rows, 0, chunk, ROTATION_ZERO);
  return new Uint8Array(rows.buffer);
}

/**
 * Writes the rows of a chunk.
 *
 * @param {Uint8ClampedArray} rows of its buffer from the start on
 * @param {number} first row to write
 * @param {Parameters<typeof rowsOf>[0]} chunk
 * @param {number} zero a byte b of a rotation stands for b / zero - 1
 */
export function writeRows(rows, first, { count, positions, scales, rotations, opacities, dc }, zero) {
  const floats = new Float32Array(rows.buffer);
  for (let i = 0; i < count; i++) {
    const [at, float] = [ROW * (first + i), (ROW / 4) * (first + i)];
    for (let k = 0; k < 3; k++) {
      floats[float + k] = positions[3 * i + k];
      floats[float + 3 + k] = Math.exp(scales[3 * i + k]);
      rows[at + 24 + k] = 255 * (0.5 + SH_C0 * dc[3 * i + k]);
    }
    rows[at + 27] = 255 / (1 + Math.exp(-opacities[i]));
    const [w, x, y, z] = rotations.subarray(4 * i, 4 * i + 4);
    const length = Math.hypot(w, x, y, z);
    const unit = length > 0 ? [w / length, x / length, y / length, z / length] : [1, 0, 0, 0];
    unit.forEach((v, k) => (rows[at + 28 + k] = v * zero + zero));
  }
}
