import type { AssetContainer } from '@babylonjs/core/assetContainer.js';
import type {
  ISceneLoaderAsyncResult,
  ISceneLoaderPluginAsync,
  ISceneLoaderPluginFactory,
  ISceneLoaderProgressEvent,
} from '@babylonjs/core/Loading/sceneLoader.js';
import type { GaussianSplattingMesh } from '@babylonjs/core/Meshes/GaussianSplatting/gaussianSplattingMesh.js';
import type { Scene } from '@babylonjs/core/scene.js';
import type { OpenOptions } from './index.js';

/** How much of a scene a mesh shows. */
export interface There {
  gaussians: number;
  of: number;
}

export interface LexiLoaderOptions extends Pick<OpenOptions, 'workers' | 'memory' | 'shParts' | 'signal'> {
  /**
   * Asks for the mesh while its file arrives. It is called each time that the mesh shows more, coarse to fine; the mesh is
   * whole when the call of Babylon's loader resolves.
   */
  onRefine?: (mesh: GaussianSplattingMesh, there: There) => void;
}

declare module '@babylonjs/core/Loading/sceneLoader.js' {
  interface SceneLoaderPluginOptions {
    /** Options of the loader of .lexi files. */
    lexi?: Partial<LexiLoaderOptions>;
  }
}

/**
 * Lets Babylon (9 or later) load .lexi files by ImportMeshAsync and its kin, as a GaussianSplattingMesh with SH up to degree
 * 4. The mesh stands as that of a PLY: mirrored, so that y points up.
 * @param options of all such files; `pluginOptions: { lexi: ... }` of a call come before them
 */
export function registerLexi(options?: LexiLoaderOptions): void;

/** The plugin that `registerLexi` gives to RegisterSceneLoaderPlugin. */
export class LexiFileLoader implements ISceneLoaderPluginAsync, ISceneLoaderPluginFactory {
  constructor(options?: LexiLoaderOptions);
  readonly name: 'lexi';
  readonly extensions: { readonly '.lexi': { readonly isBinary: true } };
  createPlugin(options: { lexi?: LexiLoaderOptions }): LexiFileLoader;
  loadFile(scene: Scene, fileOrUrl: File | string | ArrayBufferView, rootUrl: string, onSuccess: (data: unknown) => void): null;
  importMeshAsync(
    meshesNames: unknown,
    scene: Scene,
    data: unknown,
    rootUrl: string,
    onProgress?: (event: ISceneLoaderProgressEvent) => void,
  ): Promise<ISceneLoaderAsyncResult>;
  loadAsync(scene: Scene, data: unknown, rootUrl: string, onProgress?: (event: ISceneLoaderProgressEvent) => void): Promise<void>;
  loadAssetContainerAsync(
    scene: Scene,
    data: unknown,
    rootUrl: string,
    onProgress?: (event: ISceneLoaderProgressEvent) => void,
  ): Promise<AssetContainer>;
}
