/** What a worker does that draws on the processor: takes scenes, draws views in steps, and stops when it is told to. */

/** Milliseconds of drawing after which messages are looked at, so that a picture can be stopped. */
const STEP = 20;

/**
 * Answers messages one after another. `stop` ends the picture that is being drawn.
 * @param {object} wasm the exports of the processor's WebAssembly
 * @param {any} [port] where messages come from: the worker itself
 */
export function serveProcessor(wasm, port = globalThis) {
  const actions = {
    module: ({ module }) => {
      ({ memory } = wasm.initSync({ module }));
      processor = new wasm.Processor();
    },
    form: ({ slot, bytes }) => processor.form(slot, bytes),
    part: ({ slot, index, bytes }) => processor.part(slot, index, bytes),
    removePart: ({ slot, index }) => processor.remove_part(slot, index),
    remove: ({ slot }) => processor.remove(slot),
    draw,
  };
  const turn = turns();
  let [processor, memory, stopped] = [];
  let before = Promise.resolve();

  async function draw({ view, mode, split, gain }) {
    stopped = false;
    if (view) {
      processor.begin(view);
      let end = performance.now() + STEP;
      while (!processor.advance()) {
        if (performance.now() < end) continue;
        await turn();
        if (stopped) return undefined;
        end = performance.now() + STEP;
      }
    }
    const figures = Float64Array.of(memory.buffer.byteLength, ...processor.figures());
    const composed = processor.compose(mode, split, gain);
    if (!composed) return { figures };
    const { width, height } = composed;
    const data = composed.take();
    composed.free();
    return { figures, width, height, data };
  }

  async function answer(message) {
    const { id, type } = message;
    try {
      const reply = await actions[type](message);
      port.postMessage({ id, reply }, reply?.data ? [reply.data.buffer] : []);
    } catch (error) {
      // After a fault of the WebAssembly itself its memory is not to be trusted.
      const fatal = error instanceof WebAssembly.RuntimeError;
      port.postMessage({ id, error: String(error?.message ?? error), fatal });
    }
  }

  port.onmessage = ({ data }) => {
    if (data.type === 'stop') stopped = true;
    else before = before.then(() => answer(data));
  };
}

/** Gives a function that resolves after messages that wait. A timer would be held back when it is set again and again. */
function turns() {
  const { port1, port2 } = new MessageChannel();
  let go;
  port1.onmessage = () => go();
  return () =>
    new Promise((resolve) => {
      go = resolve;
      port2.postMessage(0);
    });
}
