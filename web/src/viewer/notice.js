// What is in the place of a picture that is not there: how to open a scene, why there is none, a still picture.

import { make, say } from './dom.js';

/**
 * @param {{poster?: string, open?: (() => void) | false}} options open: lets people choose files
 */
export function makeNotice({ poster, open }) {
  const still = make('img', { class: 'poster', alt: '', hidden: !poster });
  if (poster) still.src = poster;
  const title = make('h2', {});
  const text = make('p', {});
  const button = make('button', { type: 'button', class: 'main', onclick: () => open && open() }, 'Open files');
  const card = make('div', { class: 'notice', role: 'status', hidden: true }, title, text, button);
  const begin = make('button', { type: 'button', class: 'begin', hidden: true }, 'Show in 3D');
  const element = make('div', { class: 'instead' }, still, card, begin);
  let [waits, why] = [false, ''];

  function draw({ shown, active }) {
    element.hidden = shown;
    card.hidden = !why && (waits || active || !open);
    button.hidden = !open || Boolean(why);
    say(title, why ? 'The scene cannot be drawn here' : 'Open a scene');
    say(text, why || 'Drop one or two files here, or choose them: .lexi, .ply, .spz, .sog, .splat, .ksplat or .glb. They stay on this device.');
  }

  return {
    element,
    /** Says that a scene was asked for. */
    busy: () => {
      waits = true;
      draw({ shown: false, active: true });
    },
    /** Says why nothing can be drawn. */
    cannot: (text) => {
      why = text;
      draw({ shown: false, active: false });
    },
    update: ({ shown, active }) => {
      if (active || shown) waits = false;
      draw({ shown, active });
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
