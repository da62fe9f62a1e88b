// Views of a scene, as in cameras.json: columns of a rotation are right, down and forward.

const ANGLE = (50 / 180) * Math.PI;
// How far away a camera is, in distances from the middle within which 9 of 10 Gaussians are.
const AWAY = 2.5;
const WITHIN = 0.9;

const minus = (a, b) => a.map((value, k) => value - b[k]);
const unit = (a) => a.map((value) => value / Math.hypot(...a));
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

/**
 * Views around a scene, from a little above its middle.
 * @param {Float32Array} positions 3 a Gaussian
 * @param {number} count of views
 * @param {number} size of a picture's sides, pixels
 */
export function orbit(positions, count, size) {
  const gaussians = positions.length / 3;
  const column = (k) => Float32Array.from({ length: gaussians }, (_, i) => positions[3 * i + k]).sort();
  const middle = [0, 1, 2].map((k) => column(k)[Math.floor(gaussians / 2)]);
  const distances = Float32Array.from({ length: gaussians }, (_, i) =>
    Math.hypot(...minus([...positions.subarray(3 * i, 3 * i + 3)], middle)),
  ).sort();
  const away = AWAY * distances[Math.floor(WITHIN * (gaussians - 1))];
  const focal = size / 2 / Math.tan(ANGLE / 2);
  return Array.from({ length: count }, (_, n) => {
    const turn = (2 * Math.PI * n) / count + 0.3;
    // y points down.
    const position = [middle[0] + away * Math.cos(turn), middle[1] - 0.3 * away, middle[2] + away * Math.sin(turn)];
    const forward = unit(minus(middle, position));
    const right = unit(cross([0, 1, 0], forward));
    const down = cross(forward, right);
    const rotation = [0, 1, 2].map((k) => [right[k], down[k], forward[k]]);
    return { width: size, height: size, fx: focal, fy: focal, position, rotation };
  });
}

/**
 * A view of cameras.json at another width.
 * @param {{width: number, height: number, fx: number, fy: number}} view
 * @param {number} width pixels
 */
export function scaled(view, width) {
  const by = width / view.width;
  return { ...view, width, height: Math.round(view.height * by), fx: view.fx * by, fy: view.fy * by };
}
