/** Where the parts of the viewer are. */
export interface Program {
  /** Gives the compiled viewer. */
  compile: () => Promise<WebAssembly.Module>;
  /** Starts a worker that decodes. */
  worker: () => Worker;
  /** How many of them; 0 decodes on the page's thread. */
  workers: number;
  /** What draws where there is no WebGPU. Without it nothing is drawn there. */
  processor?: {
    /** Gives the compiled renderer. */
    compile: () => Promise<WebAssembly.Module>;
    /** Starts a worker that draws. */
    worker: () => Worker;
  };
}

export type ViewMode = 'first' | 'second' | 'side' | 'wipe' | 'difference';

/** A scene that the viewer has. */
export interface ViewerModel {
  name: string;
  /** Of the file. */
  bytes: number;
  gaussians: number;
  layout: string;
}

/** The scenes that are shown, and their figures. */
export interface ViewerReport {
  /** Name of the device that draws. */
  device: string;
  /** Who draws: WebGPU, or the processor. */
  renderer: 'webgpu' | 'processor';
  mode: ViewMode;
  view: ViewerView | null;
  /** Name of the camera. */
  camera: string | null;
  /** Number of the camera among `cameras`, from 0. */
  index: number;
  cameras: number;
  /** Whether the view was moved away from the cameras. */
  free: boolean;
  /** Of the picture, in device pixels. */
  width: number;
  height: number;
  /** Time of the last picture; null before there is one. */
  milliseconds: number | null;
  /** Gaussians drawn of each scene. */
  drawn: [number | null, number | null];
  /** Bytes on the GPU, or of the worker that draws. */
  resident_bytes: number;
  scene_bytes: [SceneBytes | null, SceneBytes | null];
  /** dB; null while there are not two scenes to compare. */
  psnr: number | null;
  identical: boolean;
  split: number;
  gain: number;
  /** Highest SH degree that is drawn; null draws all. */
  degree: number | null;
  background: [number, number, number];
  models: [ViewerModel | null, ViewerModel | null];
  /** The parts that are drawn of scenes with more Gaussians than the budget; undefined for other scenes. */
  streams: (StreamState | undefined)[];
}

/** A scene with more Gaussians than the budget: numbers of Gaussians and bytes. */
export interface StreamState {
  /** Gaussians, and bytes of the file, that were chosen. */
  splats: number;
  bytes: number;
  /** Gaussians that are drawn. */
  drawn: number;
  /** Bytes of the file that are held. */
  held: number;
  /** Whether all that was chosen is there. */
  complete: boolean;
}

/** Words at a point of the scene. */
export interface Annotation {
  /** The point, in units of the scene. */
  at: [number, number, number];
  text: string;
  /** Where the view goes when it is chosen: a link's part after `view=`. */
  view?: string;
}

/** From where the picture is drawn. */
export interface ViewerView {
  /** Of the picture, and its focal lengths, in device pixels. */
  width: number;
  height: number;
  focal: [number, number];
  position: [number, number, number];
  /** Its columns are right, down and forward in the scene. */
  rotation: [[number, number, number], [number, number, number], [number, number, number]];
}

export interface SceneBytes {
  geometry: number;
  sh: number;
}

export interface LexiViewerEventMap extends HTMLElementEventMap {
  /** All of a scene came, or all that the budget allows of the first view. */
  load: CustomEvent<{ slot: 0 | 1; name: string } & Partial<ViewerModel>>;
  progress: CustomEvent<{ slot: 0 | 1; loaded: number; total?: number; decoded: number; gaussians: number; ms: number; stalled?: number }> & ProgressEvent;
  /** Something failed; the viewer goes on with what it had. */
  error: CustomEvent<{ message: string }> & ErrorEvent;
}

/**
 * `<lexi-viewer>`: shows a scene, or two to compare. It begins when it is seen; with a poster, when it is asked to. A scene
 * alone turns until somebody touches it.
 */
export class LexiViewer extends HTMLElement {
  /** Where the program's parts are. Set it before the first element begins if they are not beside the module. */
  static program: Program;
  /** Addresses of the scenes. */
  src: string;
  src2: string;
  /** Address of a still picture, which is shown until the scene is. */
  poster: string;
  /** Follows what the user chooses. */
  mode: ViewMode | '';
  /** `all` shows the whole panel, `none` nothing; else there is a small bar. */
  controls: 'all' | 'none' | '';
  /** The first view: what `link()` gives, or its part after `view=`. */
  camera: string;
  /** JSON: a list of {@link Annotation}. */
  annotations: string;
  /** Whether the scene does not turn by itself. It never does for people who want less motion. */
  still: boolean;
  /**
   * Most Gaussians that are drawn of a packed .lexi. Of a larger one is drawn what the view shows, near and coarse first.
   * Default 3,000,000, on phones 1,000,000, and 300,000 where the processor draws.
   */
  budget: string;
  /** Most bytes that are held of such a file. Default 128 MiB, on phones and where the processor draws 32 MiB. */
  budgetBytes: string;
  /** `processor` draws without WebGPU, as browsers that have none do. Any other value draws by WebGPU where there is one. */
  renderer: 'processor' | '';
  /** A description of the scene in words. */
  alt: string;
  /** The scenes that are shown, and their figures; undefined before there is a picture. */
  readonly report: ViewerReport | undefined;
  /** Begins now. Resolves with whether this browser can draw. */
  start(): Promise<boolean>;
  /** Opens a scene in slot 0 or 1. Resolves with whether all of it came. */
  open(source: string | URL | Blob, slot?: 0 | 1): Promise<boolean>;
  /** Returns the value of `camera` for the view that is shown; undefined before there is one. */
  link(): Promise<string | undefined>;
  /** Carries out words of a script of `lexisplat view`. Rejects with the reason if one is wrong. */
  run(words: string): Promise<void>;
  addEventListener<K extends keyof LexiViewerEventMap>(
    type: K,
    listener: (this: LexiViewer, event: LexiViewerEventMap[K]) => unknown,
    options?: boolean | AddEventListenerOptions,
  ): void;
  addEventListener(type: string, listener: EventListenerOrEventListenerObject, options?: boolean | AddEventListenerOptions): void;
}

declare global {
  interface HTMLElementTagNameMap {
    'lexi-viewer': LexiViewer;
  }
}
