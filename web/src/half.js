// Half floats, rounded to the nearest. three.js' DataUtils.toHalfFloat cuts off, which doubles the error.

// The largest half float. Infinity times 0 would be no number.
const MOST = 65504;
// Below this, half floats are multiples of 2^-24.
const LEAST_NORMAL = 2 ** -14;
// Bits of a float's fraction that a half float lacks, and how much larger a float's exponent is.
const [LOST, BIAS] = [13, 127 - 15];
const ROUND = 2 ** (LOST - 1) - 1;
const float = new Float32Array(1);
const word = new Uint32Array(float.buffer);

/**
 * @param {number} value
 * @returns {number} its 16 bits
 */
export function half(value) {
  const sign = value < 0 ? 0x8000 : 0;
  const size = Math.min(MOST, Math.abs(value));
  if (size < LEAST_NORMAL) return sign | Math.round(size * 2 ** 24);
  float[0] = size;
  const bits = word[0] - BIAS * 2 ** 23;
  return sign | ((bits + ROUND + ((bits >> LOST) & 1)) >> LOST);
}
