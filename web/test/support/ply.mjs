// A chunk of a scene as a PLY in INRIA's layout, for viewers that cannot read ours.

// Most viewers draw SH up to this degree.
const MOST_DEGREE = 3;

/**
 * @param {number} degree of the chunk's SH; of a higher one than `most`, what viewers draw is kept
 * @param {import('../../src/index.js').Chunk} chunk as 'dense'
 * @param {number} [most] degree that is written
 * @returns {Buffer}
 */
export function plyOf(degree, chunk, most = MOST_DEGREE) {
  const { count, positions, dc, sh, opacities, scales, rotations } = chunk;
  const held = (degree + 1) ** 2 - 1;
  const kept = (Math.min(degree, most) + 1) ** 2 - 1;
  const columns = [];
  const add = (names, at) => names.forEach((name, k) => columns.push({ name, value: (i) => at(i, k) }));
  add(['x', 'y', 'z'], (i, k) => positions[3 * i + k]);
  add(['nx', 'ny', 'nz'], () => 0);
  add(['f_dc_0', 'f_dc_1', 'f_dc_2'], (i, k) => dc[3 * i + k]);
  const rest = Array.from({ length: 3 * kept }, (_, k) => `f_rest_${k}`);
  add(rest, (i, k) => sh[3 * held * i + held * Math.floor(k / kept) + (k % kept)]);
  add(['opacity'], (i) => opacities[i]);
  add(['scale_0', 'scale_1', 'scale_2'], (i, k) => scales[3 * i + k]);
  add(['rot_0', 'rot_1', 'rot_2', 'rot_3'], (i, k) => rotations[4 * i + k]);

  const head = ['ply', 'format binary_little_endian 1.0', `element vertex ${count}`];
  head.push(...columns.map(({ name }) => `property float ${name}`), 'end_header', '');
  const body = Buffer.alloc(4 * count * columns.length);
  let to = 0;
  for (let i = 0; i < count; i++) for (const { value } of columns) to = body.writeFloatLE(value(i), to);
  return Buffer.concat([Buffer.from(head.join('\n'), 'latin1'), body]);
}
