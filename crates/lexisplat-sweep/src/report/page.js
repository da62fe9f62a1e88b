
// Views: one at a time, chosen by small pictures.
if (views.length) {
  const thumbs = document.querySelector(".thumbs");
  const show = number => {
    views.forEach((view, i) => { view.hidden = i !== number; });
    [...thumbs.children].forEach((button, i) => button.setAttribute("aria-pressed", i === number));
  };
  views.forEach((view, i) => {
    const button = document.createElement("button");
    button.type = "button";
    const image = document.createElement("img");
    image.src = view.querySelector(".before").src;
    image.alt = "Show " + view.dataset.name;
    button.append(image);
    button.addEventListener("click", () => show(i));
    thumbs.append(button);
  });
  thumbs.hidden = views.length < 2;
  show(0);
}

// Atoms: balls that show, for every side they can be seen from, the colour they add to mid-grey.
const box = document.getElementById("atoms");
if (box) {
  const { degree, atoms } = JSON.parse(document.getElementById("atom-data").textContent);
  const size = 64, contrast = 1.25;
  const perChannel = (degree + 1) ** 2 - 1;
  // The real SH basis of 3DGS without DC; (x, y, z) points from the viewer to the Gaussian.
  const basis = (x, y, z) => {
    const xx = x * x, yy = y * y, zz = z * z, xy = x * y, yz = y * z, xz = x * z;
    return [
      -0.48860251 * y, 0.48860251 * z, -0.48860251 * x,
      1.0925484 * xy, -1.0925484 * yz, 0.31539157 * (2 * zz - xx - yy), -1.0925484 * xz, 0.5462742 * (xx - yy),
      -0.5900436 * y * (3 * xx - yy), 2.8906114 * xy * z, -0.4570458 * y * (4 * zz - xx - yy),
      0.37317634 * z * (2 * zz - 3 * xx - 3 * yy), -0.4570458 * x * (4 * zz - xx - yy),
      1.4453057 * z * (xx - yy), -0.5900436 * x * (xx - 3 * yy),
      2.5033429 * xy * (xx - yy), -1.7701308 * yz * (3 * xx - yy), 0.9461747 * xy * (7 * zz - 1),
      -0.6690465 * yz * (7 * zz - 3), 0.10578555 * (zz * (35 * zz - 30) + 3), -0.6690465 * xz * (7 * zz - 3),
      0.47308734 * (xx - yy) * (7 * zz - 1), -1.7701308 * xz * (xx - 3 * yy),
      0.6258357 * (xx * (xx - 3 * yy) - yy * (3 * xx - yy)),
    ].slice(0, perChannel);
  };
  const pixels = [];
  for (let row = 0; row < size; row++) for (let column = 0; column < size; column++) {
    const x = (column + 0.5) / size * 2 - 1, y = (row + 0.5) / size * 2 - 1, far = x * x + y * y;
    if (far < 1) pixels.push({ at: 4 * (row * size + column), x, y, z: -Math.sqrt(1 - far), edge: Math.min(1, (1 - Math.sqrt(far)) * size / 2) });
  }
  const pens = [...box.querySelectorAll("canvas")].map(canvas => {
    canvas.width = canvas.height = size;
    return canvas.getContext("2d");
  });
  let turn = 0.5, tip = -0.35;
  const draw = () => {
    const [st, ct, sp, cp] = [Math.sin(turn), Math.cos(turn), Math.sin(tip), Math.cos(tip)];
    const table = pixels.map(({ x, y, z }) => {
      const v = cp * y - sp * z, w = sp * y + cp * z;
      // The side that faces the viewer is seen along the opposite direction.
      return basis(-(ct * x + st * w), -v, -(-st * x + ct * w));
    });
    pens.forEach((pen, k) => {
      const atom = atoms[k], image = pen.createImageData(size, size);
      pixels.forEach(({ at, edge }, p) => {
        const b = table[p];
        for (let c = 0; c < 3; c++) {
          let sum = 0;
          for (let i = 0; i < perChannel; i++) sum += b[i] * atom[c * perChannel + i];
          image.data[at + c] = 128 + 255 * contrast * sum / 1000;
        }
        image.data[at + 3] = 255 * edge;
      });
      pen.putImageData(image, 0, 0);
    });
  };
  let from = null, waiting = false;
  const redraw = () => {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; draw(); });
  };
  box.addEventListener("pointerdown", event => { from = [event.clientX, event.clientY]; box.setPointerCapture(event.pointerId); });
  box.addEventListener("pointermove", event => {
    if (!from) return;
    turn -= (event.clientX - from[0]) / 90;
    tip = Math.max(-1.5, Math.min(1.5, tip - (event.clientY - from[1]) / 90));
    from = [event.clientX, event.clientY];
    redraw();
  });
  const release = () => { from = null; };
  box.addEventListener("pointerup", release);
  box.addEventListener("pointercancel", release);
  box.addEventListener("keydown", event => {
    const step = { ArrowLeft: [0.2, 0], ArrowRight: [-0.2, 0], ArrowUp: [0, 0.2], ArrowDown: [0, -0.2] }[event.key];
    if (!step) return;
    event.preventDefault();
    turn += step[0];
    tip = Math.max(-1.5, Math.min(1.5, tip + step[1]));
    redraw();
  });
  draw();
}
