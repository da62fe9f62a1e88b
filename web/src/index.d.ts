/** Decoder of .lexi files: small 3D Gaussian Splatting scenes. */

export interface OpenOptions {
  /** Stops reading and decoding. The promise or iterator rejects with the signal's reason. */
  signal?: AbortSignal;
  onProgress?: (progress: Progress) => void;
  /** Workers that decode; default 2. With 0 the calling thread decodes. */
  workers?: number;
  /** Most bytes of the file that are held at once; default 256 MiB. */
  memory?: number;
  /** Parts of SH-rest that are fetched, those of the largest values first; default all. With 0 there is no SH-rest. */
  shParts?: number;
}

export interface Progress {
  /** Bytes of the file that came. */
  loaded: number;
  /** Bytes of the file; undefined where that is not known. */
  total?: number;
  /** Gaussians that were decoded. */
  decoded: number;
  /** Gaussians of the scene; 0 where that is not known. */
  gaussians: number;
  /** Milliseconds for which no byte came; undefined unless a download has stalled. */
  stalled?: number;
}

/** The header of a file. */
export interface Header {
  /** Version of the format. */
  version: number;
  /** `packed`, `f32`, `f16` or `paper`. */
  layout: string;
  gaussians: number;
  /** Gaussians of the scene that the file was made of, some of which may have been left out. */
  sourceGaussians: number;
  /** SH degree. */
  degree: 0 | 1 | 2 | 3 | 4;
  /** Bytes of the file. */
  bytes: number;
  /** Atoms of the dictionary. */
  atoms: number;
  /** Trained with the anti-aliased dilation, which a viewer should use too. */
  antialiased: boolean;
  /** The view from which viewers show the scene first, as the text of their links; undefined if the file states none. */
  view?: string;
  /** Number of chunks and layers. */
  chunks: number;
  layers: number;
  /** Bytes after which the whole scene can be drawn, coarsely; of packed files. */
  firstLayerEnd?: number;
}

/** The atoms that codes name. */
export interface Dictionary {
  atoms: number;
  /** Values of an atom: 45 at degree 3. */
  rest: number;
  /** An atom a row, channel-major as `f_rest_*` of a PLY: all of red, then green, then blue. */
  values: Float32Array;
}

/** How SH-rest is given: as sparse codes, as dense arrays, or not at all, in rows of a .splat. */
export type Form = 'codes' | 'dense' | 'rows';

/** Gaussians that were decoded together. Axes are those of the PLY that the file was made of. */
export interface Chunk {
  /** Number of the chunk. With `refine`, a later chunk of the same number replaces the earlier one. */
  index: number;
  layer: number;
  /** Whether it is as fine as it will be. */
  complete: boolean;
  /** Index of its first Gaussian in the scene. */
  first: number;
  count: number;
  /** Three numbers a Gaussian. */
  positions: Float32Array;
  /** Logarithms of standard deviations, three a Gaussian. */
  scales: Float32Array;
  /** Quaternions w, x, y, z, not always of norm 1. */
  rotations: Float32Array;
  /** Opacities before the sigmoid. */
  opacities: Float32Array;
  /** SH coefficients of degree 0; a colour is 0.5 + 0.28209479 dc. */
  dc: Float32Array;
  /** `as: 'codes'` */
  codes?: Codes;
  /** `as: 'dense'`: SH-rest, channel-major for each Gaussian. */
  sh?: Float32Array;
  /** `as: 'rows'`: 32 bytes a Gaussian, as in a .splat. */
  rows?: Uint8Array;
}

/** A chunk `as: 'codes'`. */
export interface CodesChunk extends Chunk {
  codes: Codes;
}

/** A chunk `as: 'dense'`. */
export interface DenseChunk extends Chunk {
  sh: Float32Array;
}

/** A chunk `as: 'rows'`. */
export interface RowsChunk extends Chunk {
  rows: Uint8Array;
}

/** Sparse codes: SH-rest of a Gaussian is the sum of its values times the atoms that its indices name. */
export interface Codes {
  /** Nonzeros of each Gaussian. */
  counts: Uint8Array;
  /** Atoms of all nonzeros, Gaussian by Gaussian. */
  indices: Uint8Array | Uint16Array;
  /** Their values: the bits of half floats, or single precision. */
  values: Uint16Array | Float32Array;
  /** Gaussians that have an exact row instead of a code, by their numbers in the chunk. */
  escapes: { gaussians: Uint32Array; rows: Float32Array };
}

export class Scene {
  private constructor();
  readonly header: Header;
  readonly dictionary: Dictionary;
  /**
   * Decodes the chunks, once. With `refine` they come coarse first and again as they get finer; without, each comes once, as
   * fine as it will be, in the order in which its bytes come.
   */
  chunks(options?: { as?: 'codes'; refine?: boolean }): AsyncIterableIterator<CodesChunk>;
  chunks(options: { as: 'dense'; refine?: boolean }): AsyncIterableIterator<DenseChunk>;
  chunks(options: { as: 'rows'; refine?: boolean }): AsyncIterableIterator<RowsChunk>;
  chunks(options: { as?: Form; refine?: boolean }): AsyncIterableIterator<Chunk>;
  /** Decodes everything to one chunk, in the order of the file. */
  all(options?: { as?: 'codes' }): Promise<CodesChunk>;
  all(options: { as: 'dense' }): Promise<DenseChunk>;
  all(options: { as: 'rows' }): Promise<RowsChunk>;
  all(options: { as?: Form }): Promise<Chunk>;
  /** Ends the workers and frees memory. */
  close(): void;
}

/**
 * Opens the .lexi file at an address, in a Blob or in memory; in Node also at a path. Gives the header before the rest of the file came.
 */
export function open(
  source: string | URL | Blob | ArrayBuffer | ArrayBufferView,
  options?: OpenOptions,
): Promise<Scene>;
