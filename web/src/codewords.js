// Codes and dictionary as texels that shaders read: a Gaussian's SH are its few nonzeros times rows of the dictionary.

import { half } from './half.js';

/** Bits of a code word that say where the nonzeros begin; those above say how many there are. */
export const OFFSET_BITS = 26;
/** The count of nonzeros that stands for an escape: SH as they are, in place of nonzeros. */
export const ESCAPE = 63;
/** Words of an escape for each coefficient: halves of red and green, half of blue. */
export const ESCAPE_WORDS = 2;
/** Atoms beside each other in a row of the dictionary's texture. */
export const ATOMS_PER_ROW = 64;

const CHANNELS = 3;
// Channels of a texel of the dictionary; textures of three channels are padded by drivers.
const TEXEL = 4;

/**
 * @param {import('./index.js').Scene['dictionary']} dictionary
 * @param {number} kept coefficients of a channel that are drawn
 * @returns {{width: number, height: number, texels: Uint16Array}} half floats; atom a begins at texel
 *     (a % ATOMS_PER_ROW) * kept of row a / ATOMS_PER_ROW, and texel i of it has coefficient i of red, green and blue
 */
export function atomTexels({ atoms, rest, values }, kept) {
  const width = ATOMS_PER_ROW * kept;
  const height = Math.max(1, Math.ceil(atoms / ATOMS_PER_ROW));
  const texels = new Uint16Array(TEXEL * width * height);
  const stride = rest / CHANNELS;
  for (let atom = 0; atom < atoms; atom++) {
    for (let i = 0; i < kept; i++) {
      for (let c = 0; c < CHANNELS; c++) texels[TEXEL * (atom * kept + i) + c] = half(values[atom * rest + c * stride + i]);
    }
  }
  return { width, height, texels };
}

/**
 * @param {import('./index.js').Chunk} chunk as 'codes'
 * @param {import('./index.js').Scene['dictionary']} dictionary
 * @param {number} kept coefficients of a channel that are drawn
 * @param {Uint32Array} order the Gaussian of each word; without it, that of its number
 * @returns {{words: Uint32Array, nonzeros: Uint32Array}} a word a Gaussian: where its nonzeros begin, and from OFFSET_BITS
 *     on how many; nonzeros: the atom, and from bit 16 on the value as a half float
 * @throws {RangeError} if nonzeros are more than a word can say
 */
export function codeWords({ count, codes }, dictionary, kept, order = Uint32Array.from({ length: count }, (_, i) => i)) {
  const { counts, indices, values, escapes } = codes;
  const halves = values instanceof Uint16Array;
  const rest = dictionary.rest;
  const escaped = new Map();
  escapes.gaussians.forEach((gaussian, i) => escaped.set(gaussian, escapes.rows.subarray(rest * i, rest * (i + 1))));
  const begins = new Uint32Array(count);
  for (let i = 0, at = 0; i < count; at += counts[i++]) {
    begins[i] = at;
    if (counts[i] >= ESCAPE && !escaped.has(i)) escaped.set(i, row(dictionary, indices, values, at, counts[i], halves));
  }
  const nonzeros = new Uint32Array(indices.length + ESCAPE_WORDS * kept * escaped.size);
  if (nonzeros.length > 2 ** OFFSET_BITS) throw new RangeError(`${nonzeros.length} nonzeros are more than a code word can name`);

  const words = new Uint32Array(count);
  let to = 0;
  order.forEach((i, index) => {
    const exact = escaped.get(i);
    words[index] = ((exact ? ESCAPE : counts[i]) * 2 ** OFFSET_BITS + to) >>> 0;
    if (exact) to = writeRow(exact, kept, nonzeros, to);
    else {
      for (let n = begins[i]; n < begins[i] + counts[i]; n++) {
        nonzeros[to++] = indices[n] | ((halves ? values[n] : half(values[n])) << 16);
      }
    }
  });
  return { words, nonzeros: nonzeros.subarray(0, to) };
}

function writeRow(row, kept, nonzeros, to) {
  const stride = row.length / CHANNELS;
  for (let i = 0; i < kept; i++) {
    nonzeros[to++] = half(row[i]) | (half(row[stride + i]) << 16);
    nonzeros[to++] = half(row[2 * stride + i]);
  }
  return to;
}

// A code of more nonzeros than a word can say is made dense.
function row({ rest, values: atoms }, indices, values, at, count, halves) {
  const sum = new Float32Array(rest);
  for (let n = at; n < at + count; n++) {
    const value = halves ? fromHalf(values[n]) : values[n];
    for (let j = 0; j < rest; j++) sum[j] += value * atoms[indices[n] * rest + j];
  }
  return sum;
}

// A half float has 10 bits of fraction, and its exponent is 15 too large.
function fromHalf(bits) {
  const [exponent, fraction] = [(bits >> 10) & 31, bits & 1023];
  const size = exponent === 0 ? fraction * 2 ** -24 : (1 + fraction / 1024) * 2 ** (exponent - 15);
  return bits & 0x8000 ? -size : size;
}
