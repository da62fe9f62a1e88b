// Stands in for the worker that draws on the processor. Before a red background a picture in full goes on until it is stopped.

const [WIDTH, HEIGHT] = [4, 3];
let stop;

onmessage = async ({ data: { id, type, view } }) => {
  if (type === 'stop') return stop?.();
  if (type !== 'draw') return postMessage({ id });
  const [scale, red] = view;
  if (scale === 1 && red === 1) {
    await new Promise((done) => (stop = done));
    return postMessage({ id });
  }
  const figures = Float64Array.of(1e6, NaN, 123, 12_345, 1e5, 1e4, NaN, NaN, NaN, NaN);
  postMessage({ id, reply: { figures, width: WIDTH, height: HEIGHT, data: new Uint8Array(4 * WIDTH * HEIGHT).fill(200).map((value, at) => (at % 4 === 3 ? 255 : value)) } });
};
