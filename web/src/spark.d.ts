import { SplatMesh, SplatMeshOptions } from '@sparkjsdev/spark';
import type { OpenOptions } from './index.js';

/** How much of a scene a mesh shows. */
export interface There {
  gaussians: number;
  of: number;
}

/** Ranges of the values that a PackedSplats can hold: by default colours from 0 to 1, SH from -1 to 1, logarithms of scales from -12 to 9. */
export interface Ranges {
  rgbMin?: number;
  rgbMax?: number;
  lnScaleMin?: number;
  lnScaleMax?: number;
  /** Most that SH of degree 1 are, to both sides of 0. */
  sh1Max?: number;
  sh2Max?: number;
  sh3Max?: number;
}

/** Options of SplatMesh for files of Spark's own kinds, which mean nothing for a .lexi. */
type OfOtherFiles =
  | 'url' | 'fileBytes' | 'fileType' | 'fileName' | 'stream' | 'streamLength' | 'packedSplats' | 'splats' | 'maxSplats'
  | 'constructSplats' | 'extSplats' | 'covSplats' | 'splatEncoding' | 'lod' | 'lodAbove' | 'nonLod' | 'paged' | 'onProgress';

export interface LexiMeshOptions extends Omit<SplatMeshOptions, OfOtherFiles>, Pick<OpenOptions, 'workers' | 'memory' | 'shParts'> {
  /** The address of the file. */
  url?: string | URL;
  /** The file itself, in place of an address. */
  fileBytes?: ArrayBuffer | Uint8Array | Blob;
  /**
   * How SH are on the GPU: `dense` as Spark packs them, of 6 to 8 bits, 40 bytes a Gaussian at degree 3; or as `codes`, which
   * take fewer bytes and are not rounded or cut off at 1, but are more work for the GPU whenever the camera moves. Of codes,
   * `createLodSplats` and `extractSplats` take no SH over.
   */
  as?: 'dense' | 'codes';
  /** Whether the mesh shows what is there while the file arrives, coarse to fine; by default it does. */
  refine?: boolean;
  /** Ranges of packed values; by default Spark's own. */
  splatEncoding?: Ranges;
  onProgress?: (event: ProgressEvent) => void;
  /** Called each time that the mesh shows more, but for the last, which is `onLoad`. */
  onRefine?: (mesh: LexiMesh, there: There) => void;
}

/**
 * A SplatMesh of Spark (2.2 or later) that is filled from a .lexi, SH up to degree 3. `initialized` resolves when all of the
 * file is there, and rejects with the reason if it cannot be had.
 */
export class LexiMesh extends SplatMesh {
  /** @throws {TypeError} if there is neither `url` nor `fileBytes` */
  constructor(options: LexiMeshOptions);
}
