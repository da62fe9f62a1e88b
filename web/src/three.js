// lexisplat/three: a Loader of three.js (r186 or later) whose geometries are what its own GaussianSplat draws.
//
//     const geometry = await new LexiLoader().loadAsync('scene.lexi');
//     scene.add(new GaussianSplat(geometry));
//
// three.js packs SH in its own way and takes no shader code for it, so the codes are made dense here.

import { Loader } from 'three';
import { open } from './index.js';
import { progressEvent } from './progress.js';
import { Assembly } from './three/assembly.js';

/** Loads .lexi files as geometries of Gaussian splats. */
export class LexiLoader extends Loader {
  #options = {};
  #refine;
  #aborts = new AbortController();

  /**
   * @param {import('./index.js').OpenOptions} options of `open`: workers, memory, shParts
   * @returns {this}
   */
  setOptions(options) {
    this.#options = options;
    return this;
  }

  /**
   * Asks for geometries of what is there while a file loads, coarse to fine. Each is whole in itself; the one of `load`
   * comes last. GaussianSplat copies its geometry and cannot grow, so make another one of each and remove the last.
   * @param {((geometry: import('three').BufferGeometry, there: {gaussians: number, of: number}) => void) | undefined} refine
   * @returns {this}
   */
  setRefine(refine) {
    this.#refine = refine;
    return this;
  }

  /**
   * @param {string} url
   * @param {(geometry: import('three').BufferGeometry) => void} onLoad
   * @param {(event: ProgressEvent) => void} [onProgress] loaded and total are bytes
   * @param {(error: unknown) => void} [onError]
   */
  load(url, onLoad, onProgress, onError) {
    const address = this.manager.resolveURL(this.path + url);
    const report = (progress) => onProgress?.(progressEvent(progress));
    this.manager.itemStart(url);
    this.#geometry(address, report)
      .then(onLoad)
      .catch((error) => {
        if (onError) onError(error);
        else console.error(error);
        this.manager.itemError(url);
      })
      .finally(() => this.manager.itemEnd(url));
  }

  /**
   * Takes the bytes of a file instead of its address.
   * @param {ArrayBuffer | Uint8Array | Blob} data
   * @returns {Promise<import('three').BufferGeometry>}
   */
  parse(data) {
    return this.#geometry(data);
  }

  /** Ends what this loader loads; `onError` gets the reason. */
  abort() {
    this.#aborts.abort();
    this.#aborts = new AbortController();
    return this;
  }

  async #geometry(source, onProgress) {
    const signals = [this.#aborts.signal, this.manager.abortController?.signal].filter(Boolean);
    const signal = AbortSignal.any?.(signals) ?? this.#aborts.signal;
    const scene = await open(source, { ...this.#options, signal, onProgress });
    try {
      const assembly = new Assembly(scene.header);
      const { stages } = assembly;
      for await (const chunk of scene.chunks({ as: 'dense', refine: this.#refine !== undefined })) {
        assembly.write(chunk);
        if (this.#refine && stages.take()) this.#refine(assembly.geometry(), { gaussians: stages.gaussians, of: stages.count });
      }
      return assembly.geometry();
    } finally {
      scene.close();
    }
  }
}
