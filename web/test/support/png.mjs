// PNG in and out for tests, without packages: 8 bits, RGB or RGBA, not interlaced, which is what browsers and the program
// write. https://www.w3.org/TR/png-3/

import { deflateSync, inflateSync } from 'node:zlib';

const SIGNATURE = Buffer.from([0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a]);
// Bytes a pixel of the colour types that are read.
const CHANNELS = { 2: 3, 6: 4 };

/**
 * @param {Uint8Array} bytes a PNG
 * @returns {{width: number, height: number, data: Uint8Array}} data: red, green, blue, alpha of each pixel
 */
export function decodePng(bytes) {
  const file = Buffer.from(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  if (!file.subarray(0, 8).equals(SIGNATURE)) throw new Error('no PNG');
  let head;
  const packed = [];
  for (let at = 8; at + 12 <= file.length; ) {
    const length = file.readUInt32BE(at);
    const type = file.toString('latin1', at + 4, at + 8);
    const body = file.subarray(at + 8, at + 8 + length);
    if (type === 'IHDR') head = body;
    if (type === 'IDAT') packed.push(body);
    at += 12 + length;
  }
  const [width, height, depth, colour, interlace] = [head.readUInt32BE(0), head.readUInt32BE(4), head[8], head[9], head[12]];
  const channels = CHANNELS[colour];
  if (depth !== 8 || !channels || interlace) throw new Error(`PNG of ${depth} bits, colour type ${colour}`);
  const rows = unfilter(inflateSync(Buffer.concat(packed)), width * channels, height, channels);
  const data = new Uint8Array(4 * width * height).fill(255);
  for (let pixel = 0; pixel < width * height; pixel++) {
    for (let c = 0; c < channels; c++) data[4 * pixel + c] = rows[channels * pixel + c];
  }
  return { width, height, data };
}

// Each row begins with the way in which it was predicted: from the left (a), from above (b), from both (c: above left).
function unfilter(raw, stride, height, channels) {
  const out = new Uint8Array(stride * height);
  for (let y = 0; y < height; y++) {
    const filter = raw[y * (stride + 1)];
    for (let x = 0; x < stride; x++) {
      const at = y * stride + x;
      const a = x >= channels ? out[at - channels] : 0;
      const b = y > 0 ? out[at - stride] : 0;
      const c = x >= channels && y > 0 ? out[at - stride - channels] : 0;
      const guess = [0, a, b, (a + b) >> 1, paeth(a, b, c)][filter];
      out[at] = raw[y * (stride + 1) + 1 + x] + guess;
    }
  }
  return out;
}

function paeth(a, b, c) {
  const [pa, pb, pc] = [Math.abs(b - c), Math.abs(a - c), Math.abs(a + b - 2 * c)];
  if (pa <= pb && pa <= pc) return a;
  return pb <= pc ? b : c;
}

/**
 * @param {{width: number, height: number, data: Uint8Array}} picture red, green, blue, alpha of each pixel
 * @returns {Buffer} a PNG of colour type 6
 */
export function encodePng({ width, height, data }) {
  const head = Buffer.alloc(13);
  head.writeUInt32BE(width, 0);
  head.writeUInt32BE(height, 4);
  head.set([8, 6], 8);
  const raw = Buffer.alloc((4 * width + 1) * height);
  for (let y = 0; y < height; y++) raw.set(data.subarray(4 * width * y, 4 * width * (y + 1)), (4 * width + 1) * y + 1);
  return Buffer.concat([SIGNATURE, part('IHDR', head), part('IDAT', deflateSync(raw)), part('IEND', Buffer.alloc(0))]);
}

function part(type, body) {
  const named = Buffer.concat([Buffer.from(type, 'latin1'), body]);
  const [length, sum] = [Buffer.alloc(4), Buffer.alloc(4)];
  length.writeUInt32BE(body.length);
  sum.writeUInt32BE(crc32(named));
  return Buffer.concat([length, named, sum]);
}

// Node has one of its own from 22.2 on only.
function crc32(bytes) {
  let sum = ~0;
  for (const byte of bytes) {
    sum ^= byte;
    for (let k = 0; k < 8; k++) sum = (sum >>> 1) ^ (sum & 1 ? 0xedb88320 : 0);
  }
  return ~sum >>> 0;
}
