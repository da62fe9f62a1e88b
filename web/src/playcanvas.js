// lexisplat/playcanvas: a parser of PlayCanvas (2.23 or later) for .lexi files, which are drawn from codes.
//
//     addLexiParser(app);
//     const asset = new pc.Asset('scene', 'gsplat', { url: 'scene.lexi' });
//
// From then on such an asset is one as any other of type gsplat.

import { open } from './index.js';
import { LexiResource } from './playcanvas/resource.js';

export { LexiResource };

/** Opens .lexi files for the engine's registry of parsers of type gsplat. */
export class LexiParser {
  /**
   * @param {import('playcanvas').AppBase} app
   * @param {import('./index.js').OpenOptions} [options] of `open`: workers, memory, shParts
   */
  constructor(app, options = {}) {
    this.app = app;
    this.options = options;
  }

  /** @param {{ext: string}} context what the engine knows of a file: its extension, in small letters */
  canParse(context) {
    return context.ext === 'lexi';
  }

  /**
   * @param {{load: string, original: string}} url
   * @param {(error: unknown, resource?: LexiResource | null) => void} callback gets null if the asset was unloaded
   * @param {import('playcanvas').Asset} asset fires `progress` with bytes there and bytes in all;
   *     its data may say `reorder: false`, as that of a PLY
   */
  async load(url, callback, asset) {
    const prepareCenters = this.app.scene?.gsplatCentersEnabled !== false;
    const unloaded = new AbortController();
    const onUnload = asset?.once('unload', () => unloaded.abort());
    let scene;
    try {
      const onProgress = ({ loaded, total }) => asset?.fire('progress', loaded, total ?? 0);
      scene = await open(await sourceOf(url, asset), { ...this.options, signal: unloaded.signal, onProgress });
      const chunk = await scene.all({ as: 'codes' });
      if (unloaded.signal.aborted) return callback(null, null);
      const choices = { prepareCenters, reorder: asset?.data?.reorder };
      callback(null, new LexiResource(this.app.graphicsDevice, scene.header, scene.dictionary, chunk, choices));
    } catch (error) {
      if (unloaded.signal.aborted) callback(null, null);
      else callback(error);
    } finally {
      onUnload?.off();
      scene?.close();
    }
  }

  /** The engine makes nothing more of a resource. */
  open(url, resource) {
    return resource;
  }
}

/**
 * Lets an application load .lexi files as assets of type gsplat.
 * @param {import('playcanvas').AppBase} app
 * @param {import('./index.js').OpenOptions} [options] of `open`: workers, memory, shParts
 * @returns {LexiParser} for `removeParser`
 * @throws {Error} if the application has no handler of type gsplat, or one of before PlayCanvas 2.23
 */
export function addLexiParser(app, options) {
  const handler = app.loader.getHandler('gsplat');
  if (!handler?.addParser) throw new Error('the application has no handler of type gsplat with addParser (PlayCanvas 2.23)');
  const parser = new LexiParser(app, options);
  handler.addParser(parser);
  return parser;
}

// An asset's file may have its bytes with it, as a response or as they are.
async function sourceOf(url, asset) {
  const contents = await asset?.file?.contents;
  return contents instanceof Response ? contents.blob() : (contents ?? new URL(url.load, document.baseURI));
}
