// Elements of the page, and figures as text.

const SVG = 'http://www.w3.org/2000/svg';
// Units of bytes above one byte, each 1000 of the one before.
const UNITS = ['kB', 'MB', 'GB', 'TB'];

/**
 * Makes an element.
 * @param {string} tag
 * @param {Record<string, unknown>} [properties] functions are listeners (`onclick`), `class` and names with `-`, `role`
 *     and `for` are attributes, others are properties of the element
 * @param {...(Node | string)} children
 * @returns {any} the element
 */
export function make(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (typeof value === 'function') element.addEventListener(name.slice(2), value);
    else if (name === 'class' || name === 'role' || name === 'for' || name.includes('-')) element.setAttribute(name, value);
    else element[name] = value;
  }
  element.append(...children);
  return element;
}

/**
 * Makes a drawing of 20 by 20 units in lines of the text's colour, which says nothing to screen readers.
 * @param {string} path of SVG
 */
export function icon(path) {
  const svg = document.createElementNS(SVG, 'svg');
  svg.setAttribute('viewBox', '0 0 20 20');
  svg.setAttribute('aria-hidden', 'true');
  const line = document.createElementNS(SVG, 'path');
  line.setAttribute('d', path);
  svg.append(line);
  return svg;
}

/**
 * Makes buttons of which one is pressed.
 * @param {string} label
 * @param {string[][]} options of each the value, the text and at will a title
 * @param {(value: string) => void} chosen
 * @returns {{element: HTMLElement, set: (value: string) => void}}
 */
export function choice(label, options, chosen) {
  const buttons = options.map(([value, text, title = '']) =>
    make('button', { type: 'button', title, value, onclick: () => chosen(value), 'aria-pressed': 'false' }, text),
  );
  const element = make('div', { class: 'choice', role: 'group', 'aria-label': label }, ...buttons);
  const set = (value) => {
    for (const button of buttons) button.setAttribute('aria-pressed', String(button.value === value));
  };
  return { element, set };
}

/** Sets the text of `element`, only where it changes, so that screen readers and selections are left in peace. */
export function say(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** Bytes in the largest unit that keeps a digit before the point. */
export function bytes(count) {
  if (count < 1000) return `${count} B`;
  let value = count / 1000;
  let unit = 0;
  for (; value >= 999.95 && unit + 1 < UNITS.length; unit++) value /= 1000;
  return `${value.toFixed(1)} ${UNITS[unit]}`;
}

/** A whole number with a comma between thousands. */
export function count(value) {
  return Math.round(value).toLocaleString('en-US');
}

/** A time in milliseconds; seconds where there are many. */
export function time(milliseconds) {
  return milliseconds < 1000 ? `${milliseconds.toFixed(1)} ms` : `${(milliseconds / 1000).toFixed(2)} s`;
}

/** Returns the reason of an error, as a sentence for people. Rust throws texts, JavaScript errors. */
export function reason(error) {
  const text = String(error?.message ?? error).trim() || 'it failed without a reason';
  return /[.!?]$/.test(text) ? text : `${text}.`;
}
