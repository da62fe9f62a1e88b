// The page of the viewer: the address says what it shows and from where.

import { App } from './app.js';
import { listenToDrops } from './drop.js';

// The title of a page that was given no other.
const PLAIN_TITLE = 'lexisplat';

/**
 * Fills the page with a viewer.
 * @param {import('./engine.js').Program} program where the program's parts are
 * @param {(string | Blob | undefined)[]} [scenes] those that the page carries
 */
export function startPage(program, scenes = []) {
  const { poster, words, controls, still } = document.body.dataset;
  // A page that carries its scene loads nothing.
  const carries = scenes.some(Boolean);
  const titled = document.title !== PLAIN_TITLE;
  const root = document.getElementById('viewer').attachShadow({ mode: 'open' });
  const address = new URLSearchParams(carries ? '' : location.search);
  const renderer = new URLSearchParams(location.search).get('renderer') ?? undefined;
  const budget = { splats: address.get('budget'), bytes: address.get('budget-bytes') };
  const app = new App(root, { program, controls, still: still !== undefined, renderer, budget, whole: true, poster, link, on: told });
  if (controls === 'all') {
    listenToDrops(window, {
      signal: new AbortController().signal,
      hover: (over) => app.element.classList.toggle('over', over),
      take: (files, first) => app.take(files, first),
    });
  }
  window.addEventListener('hashchange', () => restore());

  app.arrange({ words });
  restore();
  const given = [address.get('url') ?? scenes[0], address.get('url2') ?? scenes[1]];
  if (given.some(Boolean)) for (const [slot, source] of given.entries()) source && app.open(source, slot);
  else app.start();
  return app;

  function told(name, report) {
    if (name !== 'view') return;
    const names = report.models.filter(Boolean).map((model) => model.name);
    if (names.length > 0 && !titled) document.title = names.join(' and ');
  }

  function restore() {
    const text = location.hash.slice(1);
    if (!text) return;
    try {
      app.arrange({ link: decodeURIComponent(text) });
    } catch {
      app.fail('The view of the link could not be read.');
    }
  }

  async function link() {
    try {
      const text = `${location.href.split('#')[0]}#${encodeURI(await app.link())}`;
      try {
        history.replaceState(null, '', text);
        await navigator.clipboard.writeText(text);
        const dropped = app.loads.slots.some((load) => load?.file);
        app.messages.add(dropped ? 'The link was copied. It holds the view, not the files' : 'The link was copied');
      } catch {
        app.messages.add('This is the link to the view', { text });
      }
    } catch (error) {
      app.fail(error);
    }
  }
}
