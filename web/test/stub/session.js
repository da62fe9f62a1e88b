// Stands in for src/session.js in tests of the page: a scene is text, `lexi NAME GAUSSIANS PARTS`, then parts of 100 bytes.

const PART = 100;

export async function show(source, { slot, onForm, onPart, onProgress, signal, env, budget, memory }) {
  if (!(slot === 0 || slot === 1) || !env.wasm || !(budget.splats > 0 && budget.bytes > 0 && memory > 0)) throw new Error('a call without what it needs');
  if (location.protocol === 'file:') await echo(env.worker());
  const answer = source instanceof Blob ? new Response(source) : await fetch(source, { signal });
  if (!answer.ok) throw new Error(`the server answered ${answer.status}`);
  const total = source instanceof Blob ? source.size : Number(answer.headers.get('content-length')) || undefined;
  const began = performance.now();
  const reader = answer.body.getReader();
  let [text, loaded, info, parts] = ['', 0, undefined, 0];
  for (;;) {
    const { done, value } = await reader.read();
    if (done) break;
    signal.throwIfAborted();
    text += new TextDecoder('latin1').decode(value);
    loaded += value.length;
    if (!info && (text.includes('\n') || text.length > 64)) {
      const [, name, gaussians, many] = /^lexi (\S+) (\d+) (\d+)\n/.exec(text) ?? [];
      if (!name) throw new Error('this is not a scene that can be read');
      info = { name, bytes: total ?? 0, gaussians: Number(gaussians), layout: 'packed', many: Number(many) };
      text = text.slice(text.indexOf('\n') + 1);
      await onForm(new Uint8Array(8), info);
    }
    for (; info && text.length >= PART; text = text.slice(PART)) await onPart(parts++, new Uint8Array(PART));
    if (info?.name === 'stalls') {
      onProgress({ loaded: 100, total, decoded: 0, gaussians: info.gaussians, ms: 1, stalled: 12_000 });
      await new Promise((_, failed) => signal.addEventListener('abort', () => failed(signal.reason)));
    }
    const decoded = info ? Math.min(info.gaussians, (info.gaussians * parts) / Math.max(1, info.many)) : 0;
    onProgress({ loaded, total, decoded, gaussians: info?.gaussians ?? 0, ms: performance.now() - began });
  }
  if (!info) throw new Error('this is not a scene that can be read');
  if (parts < info.many) throw new Error('the connection was cut');
  return { info };
}

// The worker of the page of one file is asked whether it is there.
function echo(worker) {
  return new Promise((done, failed) => {
    worker.onmessage = () => done(worker.terminate());
    worker.onerror = () => failed(new Error('the worker did not start'));
    worker.postMessage('there');
  });
}
