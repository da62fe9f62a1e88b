import { BufferGeometry, Loader, LoadingManager } from 'three';
import type { OpenOptions } from './index.js';

/** How much of a scene a geometry has. */
export interface There {
  gaussians: number;
  of: number;
}

/**
 * Loads .lexi files as geometries for three.js' own `GaussianSplat` (r186 or later, WebGPURenderer), SH up to degree 3.
 * Request headers and credentials of `Loader` are not sent: fetch such a file yourself and `parse` it.
 */
export class LexiLoader extends Loader<BufferGeometry> {
  constructor(manager?: LoadingManager);

  /** Options of `open`: workers, memory, shParts. */
  setOptions(options: Pick<OpenOptions, 'workers' | 'memory' | 'shParts'>): this;

  /**
   * Asks for geometries of what is there while a file loads, coarse to fine, each whole in itself. `GaussianSplat` copies
   * its geometry and cannot grow: make another one of each, and remove the last. The geometry of `load` comes after them.
   */
  setRefine(refine?: (geometry: BufferGeometry, there: There) => void): this;

  load(
    url: string,
    onLoad: (geometry: BufferGeometry) => void,
    onProgress?: (event: ProgressEvent) => void,
    onError?: (error: unknown) => void,
  ): void;

  /** Takes the bytes of a file. It decodes in workers, so it gives a promise. */
  parse(data: ArrayBuffer | Uint8Array | Blob): Promise<BufferGeometry>;

  /** Ends what this loader loads; `onError` gets an AbortError. */
  abort(): this;
}
