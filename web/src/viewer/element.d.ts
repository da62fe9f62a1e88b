/** Where the parts of the viewer are. */
export interface Place {
  /** Gives the compiled viewer. */
  compile: () => Promise<WebAssembly.Module>;
  /** Address of the script of decoding workers. */
  worker: string;
  /** How many of them; 0 decodes on the page's thread. */
  workers: number;
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

/** What is shown, and its figures. */
export interface ViewerReport {
  device: string;
  mode: ViewMode;
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
  /** Bytes on the GPU. */
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
}

export interface SceneBytes {
  geometry: number;
  sh: number;
}

export interface LexiViewerEventMap extends HTMLElementEventMap {
  /** All of a scene came. */
  load: CustomEvent<{ slot: 0 | 1; name: string } & Partial<ViewerModel>>;
  progress: CustomEvent<{ slot: 0 | 1; loaded: number; total?: number; decoded: number; gaussians: number; ms: number }> & ProgressEvent;
  /** Something failed; the viewer goes on with what it had. */
  error: CustomEvent<{ message: string }> & ErrorEvent;
}

/** `<lexi-viewer>`: shows a scene, or two to compare. It begins when it is seen; with a poster, when it is asked to. */
export class LexiViewer extends HTMLElement {
  /** Where the program's parts are. Set it before the first element begins if they are not beside the module. */
  static place: Place;
  /** Addresses of the scenes. */
  src: string;
  src2: string;
  /** Address of a still picture, which is shown until the scene is. */
  poster: string;
  /** Follows what the user chooses. */
  mode: ViewMode | '';
  /** Whether the panel is shown. */
  controls: boolean;
  /** What the scene is, in words. */
  alt: string;
  /** What is shown and its figures; undefined before there is a picture. */
  readonly report: ViewerReport | undefined;
  /** Begins now. Resolves with whether this browser can draw. */
  start(): Promise<boolean>;
  /** Opens a scene in slot 0 or 1. Resolves with whether all of it came. */
  open(source: string | URL | Blob, slot?: 0 | 1): Promise<boolean>;
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
