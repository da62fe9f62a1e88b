// The Gaussians of a scene that are there while its chunks come, and when a viewer should be given them anew.

// A viewer takes all of a scene each time. It is given one when this many times more Gaussians are there than the last
// time: all of them together then have fewer Gaussians than the scene has twice.
const GROWTH = 2;

/** Counts the chunks of a scene, each of which may come again, finer. */
export class Stages {
  #shown = 0;
  #chunks = new Map();

  /** @param {number} count Gaussians of the scene */
  constructor(count) {
    this.count = count;
    /** How many Gaussians are there. */
    this.gaussians = 0;
  }

  /** @param {import('./index.js').Chunk} chunk that is there now */
  note({ index, first, count, complete }) {
    if (!this.#chunks.has(index)) this.gaussians += count;
    this.#chunks.set(index, { first, count, complete });
  }

  /** Whether all Gaussians are there as fine as they come. */
  get complete() {
    return this.gaussians === this.count && [...this.#chunks.values()].every(({ complete }) => complete);
  }

  /** Where the Gaussians that are there begin in the scene, and how many they are, chunk by chunk. */
  get runs() {
    return [...this.#chunks.values()];
  }

  /** Whether a viewer should be given what is there, which it then has. A scene that is complete is not asked about. */
  take() {
    const { gaussians, count } = this;
    const isDue = gaussians > this.#shown && (gaussians >= GROWTH * this.#shown || gaussians === count) && !this.complete;
    if (isDue) this.#shown = gaussians;
    return isDue;
  }

  /**
   * The rows of the Gaussians that are there, one after another.
   * @template {{subarray: Function, set: Function, constructor: new (length: number) => T}} T
   * @param {T} array of all Gaussians
   * @param {number} size elements of a row
   * @returns {T} the array itself once all are there
   */
  gathered(array, size) {
    if (this.gaussians === this.count) return array;
    const out = new array.constructor(size * this.gaussians);
    let at = 0;
    for (const { first, count } of this.#chunks.values()) {
      out.set(array.subarray(size * first, size * (first + count)), at);
      at += size * count;
    }
    return out;
  }
}
