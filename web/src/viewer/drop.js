// Files that are dropped.

/**
 * Listens to files dropped on `target`.
 * @param {EventTarget} target
 * @param {{signal: AbortSignal, hover: (over: boolean) => void, take: (files: File[], first: boolean) => void}} options
 *     first: whether shift was held
 */
export function listenToDrops(target, { signal, hover, take }) {
  const on = (name, listener) => target.addEventListener(name, listener, { signal });
  const files = (event) => event.dataTransfer?.types.includes('Files');
  on('dragover', (event) => {
    // Without this the browser would leave the page for the file.
    event.preventDefault();
    if (files(event)) hover(true);
  });
  on('dragleave', (event) => {
    if (!event.relatedTarget) hover(false);
  });
  on('drop', (event) => {
    event.preventDefault();
    hover(false);
    take([...(event.dataTransfer?.files ?? [])], event.shiftKey);
  });
}
