// Mouse, pen and fingers on the canvas: orbit, look, pan, nearer and farther.

// Pixels of CSS that a drag moves for one radian of an orbit.
const ORBIT = 200;
// Factor on the distance for one pixel of scrolling, as in the window of `lexisplat view`.
const WHEEL = 0.998;
// Pixels that one line of scrolling stands for.
const LINE = 16;

/**
 * Steers by pointers.
 * @param {import('./stage.js').Stage} stage
 * @param {{signal: AbortSignal, wheel: () => boolean, touched: () => void}} options wheel: whether the wheel is the canvas's
 *     at the moment, or scrolls the page around it; touched: is told that somebody steers
 */
export function listenToPointers(stage, { signal, wheel, touched }) {
  const { canvas } = stage;
  const held = new Map();
  const move = (change) => stage.act(change, true).catch(stage.on.failed);
  const on = (name, listener, options) => canvas.addEventListener(name, listener, { signal, ...options });

  on('pointerdown', (event) => {
    touched();
    canvas.setPointerCapture(event.pointerId);
    held.set(event.pointerId, event);
  });
  for (const end of ['pointerup', 'pointercancel', 'lostpointercapture']) on(end, (event) => held.delete(event.pointerId));
  on('contextmenu', (event) => event.preventDefault());

  on('pointermove', (event) => {
    const before = held.get(event.pointerId);
    if (!before) return;
    const pair = [...held.values()];
    held.set(event.pointerId, event);
    if (pair.length > 2) return;
    if (pair.length === 2) {
      const after = pair.map((pointer) => (pointer === before ? event : pointer));
      return pinch(pair, after);
    }
    const by = [event.clientX - before.clientX, event.clientY - before.clientY];
    if (by[0] === 0 && by[1] === 0) return;
    if (event.shiftKey || (event.buttons & 6) !== 0) pan(by);
    else if (event.ctrlKey || event.metaKey) move((viewer) => viewer.look(-by[0] / ORBIT, -by[1] / ORBIT));
    else move((viewer) => viewer.orbit(by[0] / ORBIT, by[1] / ORBIT));
  });

  on(
    'wheel',
    (event) => {
      if (!wheel()) return;
      event.preventDefault();
      touched();
      const pixels = event.deltaY * (event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? 1 : LINE);
      move((viewer) => viewer.dolly(WHEEL ** -pixels));
    },
    { passive: false },
  );

  on('dblclick', (event) => {
    const box = canvas.getBoundingClientRect();
    const [x, y] = [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
    move((viewer) => viewer.focus(x, y));
  });

  function pan([right, down]) {
    const short = Math.max(1, Math.min(canvas.clientWidth, canvas.clientHeight));
    move((viewer) => viewer.pan(right / short, down / short));
  }

  // Two fingers move the scene with the point between them, and draw it nearer as they part.
  function pinch(before, after) {
    const [from, to] = [before, after].map(([a, b]) => ({
      x: (a.clientX + b.clientX) / 2,
      y: (a.clientY + b.clientY) / 2,
      apart: Math.max(1, Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY)),
    }));
    pan([to.x - from.x, to.y - from.y]);
    if (to.apart !== from.apart) move((viewer) => viewer.dolly(from.apart / to.apart));
  }
}
