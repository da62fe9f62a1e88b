// How far a scene is that is being loaded, as people read it. Bars and texts are made of the same numbers.

import { bytes, count } from './dom.js';

/**
 * The share of its bytes that came, 0 to 1; undefined where the bytes of the file are not known.
 * @param {import('./loads.js').Load} load
 */
export function shareOf({ progress }) {
  return progress?.total > 0 ? Math.min(1, progress.loaded / progress.total) : undefined;
}

/** A share of the bytes in whole per cents. It is 100 only when all came. */
export function percent(share) {
  return `${Math.floor(100 * share)} %`;
}

/** Returns the bytes of a load that came, and their share. */
export function arrived(load) {
  if (!load.progress) return 'Waiting for the first bytes';
  const { loaded, total } = load.progress;
  const share = shareOf(load);
  return share === undefined ? bytes(loaded) : `${bytes(loaded)} of ${bytes(total)}, ${percent(share)}`;
}

/** Returns the message for a load that goes on but gets no bytes; empty for others. */
export function stalled({ active, progress }) {
  return active && progress?.stalled ? `Nothing has come for ${count(progress.stalled / 1000)} s` : '';
}

/** Sets a bar to what came; it moves by itself where that is not known. */
export function setBar(bar, load) {
  const share = load && shareOf(load);
  if (share === undefined) bar.removeAttribute('value');
  else bar.value = share;
}
