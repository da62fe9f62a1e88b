import { AppBase, Asset, GraphicsDevice, GSplatResourceBase } from 'playcanvas';
import type { Chunk, OpenOptions, Scene } from './index.js';

type ParserOptions = Pick<OpenOptions, 'workers' | 'memory' | 'shParts'>;

/**
 * Lets an application (PlayCanvas 2.23 or later) load .lexi files as assets of type gsplat.
 * @returns the parser, for `removeParser` of the handler
 * @throws if the application has no handler of type gsplat with `addParser`
 */
export function addLexiParser(app: AppBase, options?: ParserOptions): LexiParser;

/** A parser for the registry of the engine's handler of type gsplat. */
export class LexiParser {
  constructor(app: AppBase, options?: ParserOptions);
  canParse(context: { ext: string }): boolean;
  /**
   * Calls back with the resource, or with null if the asset was unloaded before it was there. The asset fires `progress`;
   * its data may say `reorder: false`, as that of a PLY.
   */
  load(
    url: { load: string; original: string },
    callback: (error: unknown, resource?: LexiResource | null) => void,
    asset: Asset,
  ): Promise<void>;
  open(url: string, resource: LexiResource): LexiResource;
}

/** The resource that an entity's gsplat component draws: geometry, codes and dictionary in textures, SH up to degree 3. */
export class LexiResource extends GSplatResourceBase {
  /** `chunk` is a whole scene, as 'codes'. */
  constructor(
    device: GraphicsDevice,
    header: Scene['header'],
    dictionary: Scene['dictionary'],
    chunk: Chunk,
    options?: { prepareCenters?: boolean; reorder?: boolean },
  );
  /** Bytes of the textures on the GPU. */
  readonly bytes: number;
}
