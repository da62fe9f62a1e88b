// Annotations: words at points of the scene.

import { make, reason } from './dom.js';

// Most of them, so that a wrong text cannot fill the page with elements.
const MOST = 200;

/**
 * Reads annotations: a JSON array of objects with `at` (three numbers), `text`, and at will `view` (a place of a link).
 * @param {string} text
 * @returns {{at: number[], text: string, view?: string}[]}
 * @throws {Error} saying what is wrong
 */
export function parseMarks(text) {
  if (!text?.trim()) return [];
  let list;
  try {
    list = JSON.parse(text);
  } catch (error) {
    throw new Error(`annotations: this is not JSON: ${reason(error)}`);
  }
  if (!Array.isArray(list) || list.length > MOST) throw new Error(`annotations: expected a list of at most ${MOST}`);
  for (const [number, mark] of list.entries()) {
    const isPoint = Array.isArray(mark?.at) && mark.at.length === 3 && mark.at.every(Number.isFinite);
    if (!isPoint) throw new Error(`annotations: number ${number + 1}: at has to be three numbers`);
    if (typeof mark.text !== 'string') throw new Error(`annotations: number ${number + 1}: text is missing`);
    if (mark.view !== undefined && typeof mark.view !== 'string') throw new Error(`annotations: number ${number + 1}: view has to be a text`);
  }
  return list;
}

/**
 * Where a point of the scene is in the picture.
 * @param {number[]} point
 * @param {{width: number, height: number, focal: number[], position: number[], rotation: number[][]}} view of a report
 * @param {[number, number]} size of the canvas in the same pixels, in whose middle the picture is
 * @returns {[number, number] | undefined} shares of the canvas from its left and upper edge; undefined if it is not seen
 */
export function placeOf(point, { width, height, focal, position, rotation }, size) {
  const off = point.map((value, axis) => value - position[axis]);
  const [right, down, depth] = [0, 1, 2].map((k) => off.reduce((sum, value, row) => sum + value * rotation[row][k], 0));
  if (!(depth > 0)) return undefined;
  const place = [(focal[0] * right) / depth, (focal[1] * down) / depth];
  if (Math.abs(place[0]) > width / 2 || Math.abs(place[1]) > height / 2) return undefined;
  return [0.5 + place[0] / size[0], 0.5 + place[1] / size[1]];
}

/**
 * Makes the layer of annotations.
 * @param {(view: string) => void} go is called with the view of one that was chosen
 */
export function makeMarks(go) {
  const element = make('div', { class: 'marks' });
  let marks = [];

  /** Shows other annotations. */
  function set(list) {
    marks = list.map(({ at, text, view }) => {
      const dot = make('span', { class: 'dot', 'aria-hidden': 'true' });
      const mark = view
        ? make('button', { type: 'button', class: 'mark', onclick: () => go(view) }, dot, text)
        : make('span', { class: 'mark' }, dot, text);
      mark.hidden = true;
      return { at, mark };
    });
    element.replaceChildren(...marks.map(({ mark }) => mark));
  }

  /** Puts them where the viewer reports that their points are. */
  function update(report) {
    const { view, mode, width, height } = report;
    for (const { at, mark } of marks) {
      // Side by side each point is there twice.
      const place = view && mode !== 'side' ? placeOf(at, view, [width, height]) : undefined;
      mark.hidden = !place || !report.models.some(Boolean);
      if (!place) continue;
      mark.style.left = `${100 * place[0]}%`;
      mark.style.top = `${100 * place[1]}%`;
    }
  }

  return { element, set, update };
}
