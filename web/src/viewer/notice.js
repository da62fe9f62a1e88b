// The notice in place of a picture that is not there: how to open a scene, why there is none, a still picture.

import { arrived, setBar, stalled } from './arrival.js';
import { make, say } from './dom.js';

/**
 * @param {{poster?: string, open?: (() => void) | false}} options open: lets people choose files
 */
export function makeNotice({ poster, open }) {
  const still = make('img', { class: 'poster', alt: '', hidden: !poster });
  // The viewer fits a view to the shorter side of its picture, and so a still picture has to be.
  still.addEventListener('load', () => still.classList.toggle('tall', still.naturalHeight > still.naturalWidth));
  if (poster) still.src = poster;
  const title = make('h2', {});
  const text = make('p', {});
  const button = make('button', { type: 'button', class: 'main', onclick: () => open && open() }, 'Open files');
  const bar = make('progress', { 'aria-label': 'Loaded', max: 1 });
  const card = make('div', { class: 'notice', role: 'status', hidden: true }, title, text, bar, button);
  const begin = make('button', { type: 'button', class: 'begin', hidden: true }, 'Show in 3D');
  const element = make('div', { class: 'instead' }, still, card, begin);
  let [waits, why] = [false, ''];

  function draw({ shown, load }) {
    const loads = !why && (waits || Boolean(load));
    element.hidden = shown;
    card.hidden = !why && !loads && !open;
    button.hidden = !open || Boolean(why) || loads;
    bar.hidden = !loads;
    setBar(bar, load);
    say(title, why ? 'The scene cannot be drawn here' : loads ? `Loading ${load?.name ?? ''}` : 'Open a scene');
    // Where there is a panel, it says what came.
    text.hidden = loads && Boolean(open);
    const came = open ? '' : load ? [stalled(load), arrived(load)].filter(Boolean).join('. ') : 'Preparing';
    say(text, why || (loads ? came : 'Drop one or two files here, or choose them: .lexi, .ply, .spz, .sog, .splat, .ksplat or .glb. They stay on this device.'));
  }

  return {
    element,
    /** Says that a scene was asked for. */
    busy: () => {
      waits = true;
      draw({ shown: false });
    },
    /** Says why nothing can be drawn. */
    cannot: (text) => {
      why = text;
      draw({ shown: false });
    },
    /** Shows what there is to know: whether a scene is shown, and the load that may bring one. */
    update: ({ shown, load }) => {
      if (load || shown) waits = false;
      draw({ shown, load });
    },
    /** Shows another still picture. */
    poster: (address) => {
      still.hidden = !address;
      if (address) still.src = address;
      else still.removeAttribute('src');
    },
    /** Offers to begin. */
    begin: (start) => {
      begin.onclick = start;
      begin.hidden = false;
    },
    /** Takes the offer back. */
    begun: () => {
      begin.hidden = true;
    },
  };
}
