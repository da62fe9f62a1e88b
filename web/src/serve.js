/** The side of a worker: takes messages one after another and answers each. */

/**
 * @param {(module: WebAssembly.Module) => object} start gives the exports of the WebAssembly
 * @param {(exports: object) => (message: object, emit: (part: object, transfer: ArrayBuffer[]) => void) => {reply: object, transfer: ArrayBuffer[]}} handlerOf
 * @param {any} [port] where messages come from: the worker itself, or in Node the port of its parent
 */
export function serve(start, handlerOf, port = globalThis) {
  let handle;
  const take = (message) => {
    const { id } = message;
    try {
      if (message.type === 'module') {
        handle = handlerOf(start(message.module));
        port.postMessage({ id });
        return;
      }
      const began = performance.now();
      const { reply, transfer } = handle(message, (part, buffers) => port.postMessage({ id, part }, buffers));
      port.postMessage({ id, reply, milliseconds: performance.now() - began }, transfer);
    } catch (error) {
      // After a fault of the WebAssembly itself its memory is not to be trusted.
      const fatal = error instanceof WebAssembly.RuntimeError;
      port.postMessage({ id, error: String(error?.message ?? error), fatal });
    }
  };
  if (port.on) port.on('message', take);
  else port.onmessage = ({ data }) => take(data);
}
