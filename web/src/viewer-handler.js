/** Handles a message in a worker of the viewer: decoding, as the decoder's worker, and parts of scenes as the GPU holds them. */

import { handlerOf } from './handler.js';

/**
 * @param {object} wasm the exports of the viewer's WebAssembly
 * @returns {(message: object, emit: (part: object, transfer: ArrayBuffer[]) => void) => {reply: object, transfer: ArrayBuffer[]}}
 */
export function viewerHandlerOf(wasm) {
  const others = handlerOf(wasm, (chunk) => ({ form: chunk.form(), part: chunk.part() }));
  return (message, emit) => {
    if (message.type !== 'scene') return others(message, emit);
    const { name, bytes } = message;
    const onForm = (form, head) => emit({ form, head: JSON.parse(head) }, [form.buffer]);
    const onPart = (index, part, count) => emit({ index, part, count }, [part.buffer]);
    wasm.open_scene(name, bytes, onForm, onPart);
    return { reply: {}, transfer: [] };
  };
}
