/**
 * Progress as loaders of three.js and its kin give it.
 * @param {import('./index.js').Progress} progress
 */
export function progressEvent({ loaded, total }) {
  return new ProgressEvent('progress', { lengthComputable: total !== undefined, loaded, total: total ?? 0 });
}
