/** Rows of 32 bytes, as in a .splat file: position, scales, colour and opacity, rotation. */

/** Bytes of a row. */
const ROW = 32;
/** Colour is 0.5 + C0 times the SH coefficient of degree 0; this is 1 / (2 sqrt(pi)). */
const C0 = 0.28209479177387814;
/** Stands for 0 in a byte of a rotation. */
const ROTATION_ZERO = 128;

/**
 * The rows of a chunk. SH-rest, and scales and colours beyond what 8 bits hold, are lost.
 *
 * @param {{count: number, positions: Float32Array, scales: Float32Array, rotations: Float32Array, opacities: Float32Array, dc: Float32Array}} chunk
 * @returns {Uint8Array}
 */
export function rowsOf({ count, positions, scales, rotations, opacities, dc }) {
  const rows = new Uint8ClampedArray(ROW * count);
  const floats = new Float32Array(rows.buffer);
  for (let i = 0; i < count; i++) {
    for (let k = 0; k < 3; k++) {
      floats[8 * i + k] = positions[3 * i + k];
      floats[8 * i + 3 + k] = Math.exp(scales[3 * i + k]);
      rows[ROW * i + 24 + k] = 255 * (0.5 + C0 * dc[3 * i + k]);
    }
    rows[ROW * i + 27] = 255 / (1 + Math.exp(-opacities[i]));
    const [w, x, y, z] = rotations.subarray(4 * i, 4 * i + 4);
    const length = Math.hypot(w, x, y, z);
    const unit = length > 0 ? [w / length, x / length, y / length, z / length] : [1, 0, 0, 0];
    unit.forEach((v, k) => (rows[ROW * i + 28 + k] = v * ROTATION_ZERO + ROTATION_ZERO));
  }
  return new Uint8Array(rows.buffer);
}
