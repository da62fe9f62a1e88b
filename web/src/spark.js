// lexisplat/spark: a SplatMesh of Spark (@sparkjsdev/spark 2.2 or later) that is filled from a .lexi while it arrives.
//
//     const splats = new LexiMesh({ url: 'scene.lexi' });
//     scene.add(splats);

import { PackedSplats, SplatMesh } from '@sparkjsdev/spark';
import { open } from './index.js';
import { progressEvent } from './progress.js';
import { CodedSplats } from './spark/coded.js';
import { Packing } from './spark/packing.js';
import { Stages } from './stages.js';

/** How SH are on the GPU. */
const FORMS = ['dense', 'codes'];

/** A mesh of Gaussians that shows what of a .lexi file is there, coarse to fine. */
export class LexiMesh extends SplatMesh {
  #ended = new AbortController();

  /** @param {import('./spark.js').LexiMeshOptions} options where the file is, and options of SplatMesh */
  constructor({ url, fileBytes, as = 'dense', refine = true, onProgress, onRefine, splatEncoding, workers, memory, shParts, ...options }) {
    const source = fileBytes ?? url;
    if (source === undefined) throw new TypeError('lexisplat: a LexiMesh needs the url or the fileBytes of a .lexi file');
    if (!FORMS.includes(as)) throw new TypeError(`lexisplat: as is ${FORMS.join(' or ')}, not ${as}`);
    const construct = async (splats) => {
      // Spark calls this before there is a mesh.
      await undefined;
      const opening = { workers, memory, shParts, signal: this.#ended.signal, onProgress: (progress) => onProgress?.(progressEvent(progress)) };
      await this.#fill(splats, await open(source, opening), { as, refine, onRefine, splatEncoding });
    };
    super({ ...options, packedSplats: new (as === 'codes' ? CodedSplats : PackedSplats)({ construct }) });
  }

  async #fill(splats, scene, { as, refine, onRefine, splatEncoding }) {
    try {
      const { gaussians, degree } = scene.header;
      const coded = splats instanceof CodedSplats ? splats : undefined;
      const packing = new Packing(gaussians, coded ? 0 : degree, splatEncoding);
      const { packedArray, extra, encoding } = packing;
      splats.initialize({ packedArray, numSplats: 0, extra, splatEncoding: encoding });
      coded?.begin(scene.header, scene.dictionary);
      // SH are known of only now.
      this.updateGenerator();
      const stages = new Stages(gaussians);
      const show = () => {
        coded?.show();
        this.#show(splats, packing);
      };
      for await (const chunk of scene.chunks({ as, refine })) {
        packing.write(chunk);
        coded?.write(chunk);
        stages.note(chunk);
        if (!refine || !stages.take()) continue;
        show();
        onRefine?.(this, { gaussians: stages.gaussians, of: stages.count });
      }
      show();
    } finally {
      scene.close();
    }
  }

  // Spark uploads whole textures, which it makes when it first draws them.
  #show(splats, packing) {
    splats.numSplats = packing.end;
    splats.needsUpdate = true;
    for (const name of packing.textures) {
      const texture = splats.extra[name]?.value;
      if (texture) texture.needsUpdate = true;
    }
    this.updateVersion();
  }

  /** Frees what the mesh holds. If its file is still on the way, loading ends and `initialized` rejects. */
  dispose() {
    this.#ended.abort();
    this.initialized.catch(() => {});
    super.dispose();
  }
}
