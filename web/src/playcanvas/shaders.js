// How PlayCanvas reads a Gaussian of ours from textures, in both of its languages. SH are summed from codes: a Gaussian's
// few values times rows of the dictionary's texture.
//
// PlayCanvas declares load{Stream}() for each stream of the format, and calls getCenter, getRotation, getScale, getColor
// and readSHData (gsplatCopyToWorkbuffer of its shader library). SH_COEFFS is how many coefficients a channel has. Under
// GSPLAT_WORKBUFFER_GEOMETRY only colours are wanted, and PlayCanvas has the geometry from the last time.

import { ATOMS_PER_ROW, ESCAPE, ESCAPE_WORDS, OFFSET_BITS } from '../codewords.js';

const OFFSET_MASK = 2 ** OFFSET_BITS - 1;

export const GLSL = `
#ifndef GSPLAT_WORKBUFFER_GEOMETRY
uint lexiRotationXY;
vec4 lexiScaleZ;
vec3 getCenter() {
  uvec4 placed = loadLexiPlaced();
  lexiRotationXY = placed.w;
  lexiScaleZ = loadLexiShape();
  return uintBitsToFloat(placed.xyz);
}
vec4 getRotation() {
  vec3 v = vec3(unpackHalf2x16(lexiRotationXY), lexiScaleZ.w);
  return vec4(sqrt(max(0.0, 1.0 - dot(v, v))), v);
}
vec3 getScale() {
  return lexiScaleZ.xyz;
}
#endif
vec4 getColor() {
  return loadLexiColor();
}
#if SH_BANDS > 0
uint lexiWord(uint at) {
  uint width = uint(textureSize(lexiNonzeros, 0).x);
  return texelFetch(lexiNonzeros, ivec2(at % width, at / width), 0).x;
}
void readSHData(out vec3 sh[SH_COEFFS], out float scale) {
  scale = 1.0;
  uint code = loadLexiCode().x;
  uint at = code & ${OFFSET_MASK}u;
  uint count = code >> ${OFFSET_BITS}u;
  if (count == ${ESCAPE}u) {
    for (int i = 0; i < SH_COEFFS; i++) {
      uint word = at + uint(i) * ${ESCAPE_WORDS}u;
      sh[i] = vec3(unpackHalf2x16(lexiWord(word)), unpackHalf2x16(lexiWord(word + 1u)).x);
    }
    return;
  }
  for (int i = 0; i < SH_COEFFS; i++) sh[i] = vec3(0.0);
  for (uint n = 0u; n < count; n++) {
    uint nonzero = lexiWord(at + n);
    int atom = int(nonzero & 0xffffu);
    float value = unpackHalf2x16(nonzero).y;
    ivec2 row = ivec2((atom % ${ATOMS_PER_ROW}) * SH_COEFFS, atom / ${ATOMS_PER_ROW});
    for (int i = 0; i < SH_COEFFS; i++) sh[i] += value * texelFetch(lexiAtoms, row + ivec2(i, 0), 0).xyz;
  }
}
#endif
`;

export const WGSL = `
#ifndef GSPLAT_WORKBUFFER_GEOMETRY
var<private> lexiRotationXY: u32;
var<private> lexiScaleZ: vec4f;
fn getCenter() -> vec3f {
  let placed = loadLexiPlaced();
  lexiRotationXY = placed.w;
  lexiScaleZ = loadLexiShape();
  return bitcast<vec3f>(placed.xyz);
}
fn getRotation() -> vec4f {
  let v = vec3f(unpack2x16float(lexiRotationXY), lexiScaleZ.w);
  return vec4f(sqrt(max(0.0, 1.0 - dot(v, v))), v);
}
fn getScale() -> vec3f {
  return lexiScaleZ.xyz;
}
#endif
fn getColor() -> vec4f {
  return loadLexiColor();
}
#if SH_BANDS > 0
fn lexiWord(at: u32) -> u32 {
  let width = textureDimensions(lexiNonzeros, 0).x;
  return textureLoad(lexiNonzeros, vec2u(at % width, at / width), 0).x;
}
fn readSHData(sh: ptr<function, array<half3, SH_COEFFS>>, scale: ptr<function, f32>) {
 *scale = 1.0;
  let code = loadLexiCode().x;
  let at = code & ${OFFSET_MASK}u;
  let count = code >> ${OFFSET_BITS}u;
  if (count == ${ESCAPE}u) {
    for (var i = 0; i < SH_COEFFS; i++) {
      let word = at + u32(i) * ${ESCAPE_WORDS}u;
      sh[i] = half3(vec3f(unpack2x16float(lexiWord(word)), unpack2x16float(lexiWord(word + 1u)).x));
    }
    return;
  }
  var sum: array<vec3f, SH_COEFFS>;
  for (var n = 0u; n < count; n++) {
    let nonzero = lexiWord(at + n);
    let atom = i32(nonzero & 0xffffu);
    let value = unpack2x16float(nonzero).y;
    let row = vec2i((atom % ${ATOMS_PER_ROW}) * SH_COEFFS, atom / ${ATOMS_PER_ROW});
    for (var i = 0; i < SH_COEFFS; i++) {
      sum[i] += value * textureLoad(lexiAtoms, row + vec2i(i, 0), 0).xyz;
    }
  }
  for (var i = 0; i < SH_COEFFS; i++) {
    sh[i] = half3(sum[i]);
  }
}
#endif
`;
