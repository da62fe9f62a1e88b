// lexisplat/babylon: a plugin of Babylon.js' scene loader (@babylonjs/core 9 or later) for .lexi files.
//
//     registerLexi();
//     const { meshes: [splats] } = await ImportMeshAsync('scene.lexi', scene);
//
// Babylon has dense SH of 8 bits and takes no shader code for them, so the codes are made dense here.

import { RegisterSceneLoaderPlugin } from '@babylonjs/core/Loading/sceneLoader.js';
import { GaussianSplattingMesh } from '@babylonjs/core/Meshes/GaussianSplatting/gaussianSplattingMesh.js';
import { AssetContainer } from '@babylonjs/core/assetContainer.js';
import { open } from './index.js';
import { progressEvent } from './progress.js';
import { Rows } from './babylon/rows.js';
import { Stages } from './stages.js';

/** The name under which a call of Babylon's loader has options for this one. */
const NAME = 'lexi';

/** Loads .lexi files as a GaussianSplattingMesh. */
export class LexiFileLoader {
  name = NAME;
  extensions = { '.lexi': { isBinary: true } };
  #options;

  /** @param {import('./babylon.js').LexiLoaderOptions} [options] */
  constructor(options = {}) {
    this.#options = options;
  }

  /** Babylon makes a loader for each file, so that each has options of its own. */
  createPlugin(options) {
    return new LexiFileLoader({ ...this.#options, ...options[NAME] });
  }

  /** Nothing is fetched yet: the file is decoded while it arrives. */
  loadFile(scene, fileOrUrl, rootUrl, onSuccess) {
    onSuccess(fileOrUrl);
    return null;
  }

  async importMeshAsync(meshesNames, scene, data, rootUrl, onProgress) {
    return resultOf(await this.#load(scene, null, data, onProgress));
  }

  async loadAsync(scene, data, rootUrl, onProgress) {
    await this.#load(scene, null, data, onProgress);
  }

  async loadAssetContainerAsync(scene, data, rootUrl, onProgress) {
    const container = new AssetContainer(scene);
    container.meshes.push(await this.#load(scene, container, data, onProgress));
    return container;
  }

  async #load(scene, container, source, onProgress) {
    const { onRefine, ...options } = this.#options;
    const file = await open(source, { ...options, onProgress: (progress) => onProgress?.(progressEvent(progress)) });
    let mesh;
    try {
      const rows = new Rows(file.header);
      const stages = new Stages(file.header.gaussians);
      const give = () =>
        within(scene, container, () => {
          mesh ??= meshOf(scene, container, file.header);
          const { data, sh, degree } = rows.of(stages);
          mesh.updateData(data, sh, { flipY: false }, undefined, degree);
        });
      for await (const chunk of file.chunks({ as: 'dense', refine: onRefine !== undefined })) {
        if (scene.isDisposed) throw new Error('lexisplat: the scene was disposed while its file was loading');
        rows.write(chunk);
        stages.note(chunk);
        if (!onRefine || !stages.take()) continue;
        give();
        onRefine(mesh, { gaussians: stages.gaussians, of: stages.count });
      }
      give();
      return mesh;
    } catch (error) {
      mesh?.dispose();
      throw error;
    } finally {
      file.close();
    }
  }
}

/**
 * Lets Babylon load .lexi files by ImportMeshAsync, AppendSceneAsync, LoadSceneAsync and LoadAssetContainerAsync.
 * @param {import('./babylon.js').LexiLoaderOptions} [options] of all such files; pluginOptions of a call come before them
 */
export function registerLexi(options) {
  RegisterSceneLoaderPlugin(new LexiFileLoader(options));
}

// A mesh of a container is in no scene, which Babylon's own loaders say by this.
function within(scene, container, make) {
  const before = scene._blockEntityCollection;
  scene._blockEntityCollection = container !== null;
  try {
    make();
  } finally {
    scene._blockEntityCollection = before;
  }
}

// A mesh that stands as Babylon's own loader puts that of a PLY: y of the file points down, y of Babylon up.
function meshOf(scene, container, { antialiased }) {
  const mesh = new GaussianSplattingMesh('GaussianSplatting', null, scene);
  mesh._parentContainer = container;
  mesh.scaling.y = -1;
  // Babylon widens Gaussians by 0.3 pixels squared, as the trainer does; with the anti-aliased dilation they keep their light.
  if (antialiased) mesh.material.compensation = true;
  return mesh;
}

function resultOf(mesh) {
  const none = { particleSystems: [], skeletons: [], animationGroups: [], transformNodes: [], geometries: [], lights: [], spriteManagers: [] };
  return { meshes: [mesh], ...none };
}
