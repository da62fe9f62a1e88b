// The panel's text for one scene.

import { arrived, setBar, stalled } from './arrival.js';
import { bytes, count, icon, make, say, time } from './dom.js';

const CROSS = 'M6 6l8 8M14 6l-8 8';

/**
 * Makes the card of a slot.
 * @param {0 | 1} slot
 * @param {{remove: (slot: number) => void, cancel: (slot: number) => void}} on
 */
export function sceneCard(slot, on) {
  const name = make('h2', { class: 'name' });
  const remove = make('button', { type: 'button', class: 'icon cross' }, icon(CROSS));
  remove.addEventListener('click', () => (load?.active ? on.cancel(slot) : on.remove(slot)));
  const size = make('p', { class: 'strong' });
  const about = make('p', {});
  const decode = make('p', {});
  const bar = make('progress', { 'aria-label': 'Loaded', max: 1 });
  const head = make('div', { class: 'row' }, make('span', { class: 'slot', 'aria-hidden': 'true' }, String(slot + 1)), name, remove);
  const element = make('section', { class: 'card', hidden: true }, head, size, about, bar, decode);
  let [model, first, load] = [null, null, undefined];

  function update() {
    element.hidden = !model && !load;
    if (element.hidden) return;
    const title = load?.active || !model ? load?.name : model.name;
    const ordinal = slot === 0 ? 'First scene' : 'Second scene';
    element.setAttribute('aria-label', ordinal);
    say(name, title ?? '');
    name.title = title ?? '';
    remove.title = load?.active ? 'Cancel' : 'Remove';
    remove.setAttribute('aria-label', `${remove.title} ${title}`);
    const ratio = slot === 1 && first && model && first.bytes > model.bytes ? `, ${(first.bytes / model.bytes).toFixed(1)} x smaller` : '';
    say(size, model ? `${bytes(model.bytes)}${ratio}` : '');
    const { budget, shown = model?.gaussians } = load?.info ?? {};
    const less = budget ? `at most ${count(budget)} of ` : shown < model?.gaussians ? `${count(shown)} of ` : '';
    say(about, model ? `${less}${count(model.gaussians)} Gaussians, ${model.layout}` : '');
    bar.hidden = !load?.active;
    if (load?.active) setBar(bar, load);
    say(decode, load ? came(load) : '');
  }

  return {
    element,
    /** Shows what the viewer has, beside what it has of the first slot. */
    model(next, report) {
      [model, first] = [next, report?.models[0]];
      update();
    },
    /** Shows how far a load is. */
    load(next) {
      load = next;
      update();
    },
  };
}

function came(load) {
  const { active, progress } = load;
  const { decoded, gaussians, ms } = progress ?? {};
  if (!active) return ms ? `Decoded in ${time(ms)}` : '';
  const part = gaussians ? `${count(decoded)} of ${count(gaussians)} Gaussians` : '';
  return [stalled(load), arrived(load), part].filter(Boolean).join(', ');
}
