// The page of one file: the programs, their workers and the scene are text in it.

import { startPage } from './page.js';

// Workers that decode a scene, as in the folder.
const WORKERS = 2;

/** The bytes that an element has as base64. */
function bytesOf(element) {
  const text = element.textContent.trim();
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const raw = atob(text);
  const bytes = new Uint8Array(raw.length);
  for (let at = 0; at < raw.length; at++) bytes[at] = raw.charCodeAt(at);
  return bytes;
}

async function compile(id) {
  const packed = new Blob([bytesOf(document.getElementById(id))]).stream();
  const bytes = await new Response(packed.pipeThrough(new DecompressionStream('gzip'))).arrayBuffer();
  return WebAssembly.compile(bytes);
}

/** The parts of a program: its WebAssembly, and the script of its workers. */
function parts(program, script) {
  const code = new Blob([document.getElementById(script).textContent], { type: 'text/javascript' });
  const address = URL.createObjectURL(code);
  // Chromium starts no module worker from a blob of a page from disk.
  return { compile: () => compile(program), worker: () => new Worker(address) };
}

const program = { ...parts('program', 'worker'), workers: WORKERS, processor: parts('processor', 'processor-worker') };

const scenes = ['scene', 'scene2'].map((id) => {
  const element = document.getElementById(id);
  if (!element?.textContent.trim()) return undefined;
  const name = element.dataset.name || 'scene.lexi';
  try {
    return new File([bytesOf(element)], name);
  } catch {
    // The viewer says of an empty file what is wrong with it.
    return new File([], name);
  } finally {
    // The text may be larger than all else in the page.
    element.textContent = '';
  }
});
startPage(program, scenes);
