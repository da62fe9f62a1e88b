// How many Gaussians and bytes of a scene a device is given.

// Gaussians that are drawn, and bytes of a file that are held, by default. A million Gaussians of a packed file had 15 million
// bytes (docs/results/lod.md), and take about 90 MB on the GPU.
const DESKTOP = { splats: 3_000_000, bytes: 128 * 2 ** 20 };
const PHONE = { splats: 1_000_000, bytes: 32 * 2 ** 20 };
// The same where the processor draws. A picture of as many Gaussians took some tenths of a second (docs/results/web.md).
const PROCESSOR = { splats: 300_000, bytes: 32 * 2 ** 20 };

/**
 * The budget that is asked for; what is not asked for, or is no number, is what suits the device.
 * @param {{splats?: number | string | null, bytes?: number | string | null}} [asked]
 * @param {boolean} [slow] whether the processor draws
 * @returns {import('../stream.js').Budget}
 */
export function budgetOf({ splats, bytes } = {}, slow = false) {
  const suits = slow ? PROCESSOR : isPhone() ? PHONE : DESKTOP;
  const given = (value, otherwise) => (Number(value) > 0 ? Number(value) : otherwise);
  return { splats: given(splats, suits.splats), bytes: given(bytes, suits.bytes) };
}

function isPhone() {
  return navigator.userAgentData?.mobile ?? matchMedia('(pointer: coarse)').matches;
}
