// Stands in for the viewer's WebAssembly in tests of the page: it answers the same calls and paints with a 2D canvas, so
// that those tests are quick, need no build, and see each call. Its picture depends on the camera and the scenes.

const MODES = ['first', 'second', 'side', 'wipe', 'difference'];
const DEVICE = 'stub';

export default async function init() {}

/** The viewers of the page, newest last. */
globalThis.viewers = [];

export class Viewer {
  static async create(canvas, options) {
    if (globalThis.noAdapter) throw globalThis.noAdapter;
    const { promise: lost, resolve: lose } = Promise.withResolvers();
    return Viewer.#on(canvas, options, { renderer: 'webgpu', lose, device: () => ({ lost }) });
  }

  static on_processor(options) {
    return Viewer.#on(document.createElement('canvas'), options, { renderer: 'processor' });
  }

  static #on(canvas, options, given) {
    JSON.parse(options);
    const viewer = Object.assign(new Viewer(), given);
    viewer.canvas = canvas;
    viewer.pen = canvas.getContext('2d');
    viewer.calls = [];
    viewer.draws = [];
    viewer.models = [null, null];
    viewer.parts = [0, 0];
    viewer.view = { mode: 'first', split: 0.5, gain: 10, degree: null, background: [0, 0, 0], turn: [0, 0], at: [0, 0, 3] };
    viewer.busy = false;
    viewer.freed = false;
    viewer.dirty = true;
    globalThis.viewers.push(viewer);
    return viewer;
  }

  // wasm-bindgen refuses calls that overlap, and those to what was freed.
  #called(name, ...values) {
    if (this.freed) throw new Error('null pointer passed to rust');
    if (this.busy) throw new Error('recursive use of an object detected which would lead to unsafe aliasing in rust');
    this.calls.push([name, ...values]);
    this.dirty = true;
  }

  free() {
    this.#called('free');
    this.freed = true;
  }

  run(words) {
    this.#called('run', words);
    for (const word of words.split(',').filter(Boolean)) {
      const [name, value] = word.split('=');
      if (name === 'mode' && MODES.includes(value)) this.view.mode = value;
      else if (['split', 'gain', 'degree'].includes(name) && Number.isFinite(Number(value))) this.view[name] = Number(value);
      else if (word === 'degree=all') this.view.degree = null;
      else if (name === 'background') this.view.background = value.split(':').map(Number);
      else if (name === 'orbit') value.split(':').forEach((turn, axis) => (this.view.turn[axis] += (turn * Math.PI) / 180));
      else if (name === 'view' || name === 'camera') this.view.turn = [0.5, 0];
      else if (name === 'key') this.#command(value);
      else throw `${word}: expected one of the words of a script`;
    }
  }

  key(name) {
    this.#called('key', name);
    return this.#command(name);
  }

  #command(name) {
    if ('12345'.includes(name)) this.view.mode = MODES[name - 1];
    else if (name === 'R' || name === 'r') [this.view.turn, this.view.at] = [[0, 0], [0, 0, 3]];
    else return '[]+-= '.includes(name);
    return true;
  }

  orbit(right, down) {
    this.#called('orbit', right, down);
    this.view.turn = [this.view.turn[0] + right, this.view.turn[1] + down];
  }

  look(right, down) {
    this.#called('look', right, down);
  }

  pan(right, down) {
    this.#called('pan', right, down);
    this.view.at = [this.view.at[0] + right, this.view.at[1] + down, this.view.at[2]];
  }

  dolly(factor) {
    this.#called('dolly', factor);
    this.view.at[2] *= factor;
  }

  fly(right, up, forward) {
    this.#called('fly', right, up, forward);
    this.view.at[2] -= forward;
  }

  focus(x, y) {
    this.#called('focus', x, y);
  }

  resize(width, height) {
    this.#called('resize', width, height);
    [this.canvas.width, this.canvas.height] = [width, height];
  }

  async form(slot, bytes, info) {
    this.#called('form', slot, bytes.length, info);
    const one = !this.models.every(Boolean);
    this.models[slot] = JSON.parse(info);
    this.#possible(one);
    this.parts[slot] = 0;
  }

  // As the state of `lexisplat view`: a wipe when there are two, and only modes of scenes that are there.
  #possible(one) {
    const both = this.models.every(Boolean);
    if (both && one) this.view.mode = 'wipe';
    if (!both) this.view.mode = this.models[1] ? 'second' : 'first';
  }

  async part(slot, index, bytes) {
    this.#called('part', slot, index, bytes.length);
    // A scene is looked at when it is known where it is.
    if (slot === 0 && this.parts[slot] === 0) [this.view.turn, this.view.at] = [[0, 0], [0, 0, 3]];
    this.parts[slot]++;
  }

  remove_part(slot, index) {
    this.#called('remove_part', slot, index);
  }

  remove(slot) {
    this.#called('remove', slot);
    this.models[slot] = null;
    this.parts[slot] = 0;
    this.#possible(false);
  }

  // As on the processor: the page has the stand-in of the worker draw.
  begin(scale) {
    if (this.freed || this.busy) throw new Error('recursive use of an object');
    if (!this.dirty && this.finest >= scale) return undefined;
    this.dirty = false;
    this.finest = 0;
    this.draws.push(scale);
    const { width, height } = this.canvas;
    return Float32Array.of(0, MODES.indexOf(this.view.mode), this.view.split, 10, 0, 0, width, height, scale, ...this.view.background);
  }

  drawn(figures) {
    this.figures = figures;
    this.finest = this.draws.at(-1);
  }

  async draw(scale) {
    if (this.freed || this.busy) throw new Error('recursive use of an object');
    if (!this.dirty && this.finest >= scale) return false;
    this.busy = true;
    this.dirty = false;
    this.finest = scale;
    await new Promise((go) => setTimeout(go, globalThis.slow ?? 2));
    this.busy = false;
    this.draws.push(scale);
    const { width, height } = this.canvas;
    const { turn, at, background, split } = this.view;
    this.pen.fillStyle = `rgb(${background.map((share) => 255 * share).join(' ')})`;
    this.pen.fillRect(0, 0, width, height);
    this.models.forEach((model, slot) => {
      if (!model) return;
      this.pen.save();
      this.pen.beginPath();
      const line = width * (this.view.mode === 'wipe' ? split : 0.5);
      if (this.models.every(Boolean)) this.pen.rect(slot ? line : 0, 0, slot ? width - line : line, height);
      else this.pen.rect(0, 0, width, height);
      this.pen.clip();
      for (let n = 0; n < 8 * (1 + this.parts[slot]); n++) {
        const angle = n * 2.4 + turn[0];
        const far = (0.11 * height * Math.sqrt(n + 1)) / at[2];
        this.pen.fillStyle = `hsl(${(n * 47 + slot * 120) % 360} 70% ${slot ? 65 : 50}%)`;
        this.pen.beginPath();
        const [x, y] = [width / 2 + far * Math.cos(angle) + at[0] * height, height / 2 + far * Math.sin(angle) * Math.cos(turn[1]) + at[1] * height];
        this.pen.arc(x, y, height / 14 / at[2] + 4, 0, 7);
        this.pen.fill();
      }
      this.pen.restore();
    });
    return true;
  }

  // From the point `at`, along z, as wide as high.
  #seen() {
    const { width, height } = this.canvas;
    const focal = [Math.min(width, height), Math.min(width, height)];
    const [x, y, z] = this.view.at;
    return { width, height, focal, position: [-x, -y, -z], rotation: [[1, 0, 0], [0, 1, 0], [0, 0, 1]] };
  }

  report() {
    if (this.busy) throw new Error('recursive use of an object');
    const { mode, split, gain, degree, background } = this.view;
    const both = this.models.every(Boolean);
    const drawn = this.models.map((model) => model && model.gaussians);
    return JSON.stringify({
      device: DEVICE, renderer: this.renderer, mode, view: this.#seen(), camera: 'orbit 0', index: 0, cameras: 4, free: true, width: this.canvas.width, height: this.canvas.height,
      milliseconds: globalThis.cost ?? 3.2, drawn, resident_bytes: 5e6, scene_bytes: this.models.map((model) => model && { geometry: 2e6, sh: 5e5 }),
      psnr: both ? 41.27 : null, identical: false, split, gain, degree, background, models: this.models,
    });
  }

  link() {
    this.#called('link');
    const { mode, split, turn, at } = this.view;
    return `mode=${mode}&split=${split}&turn=${turn.join(':')}&at=${at.join(':')}`;
  }

  set_link(text) {
    this.#called('set_link', text);
    const parts = Object.fromEntries(text.split('&').map((part) => part.split('=')));
    if (!MODES.includes(parts.mode)) throw `${text}: this is no link to a view`;
    this.view = { ...this.view, mode: parts.mode, split: Number(parts.split), turn: parts.turn.split(':').map(Number), at: parts.at.split(':').map(Number) };
  }

  async picture() {
    this.#called('picture');
    this.busy = true;
    await new Promise((go) => setTimeout(go, 2));
    this.busy = false;
    const { width, height } = this.canvas;
    return { width, height, data: new Uint8Array(this.pen.getImageData(0, 0, width, height).data.buffer) };
  }
}
