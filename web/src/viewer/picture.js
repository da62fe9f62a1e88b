// Pictures as files.

/**
 * Saves a picture as a PNG in the folder of downloads.
 * @param {{width: number, height: number, data: Uint8Array}} picture data: red, green, blue, alpha of each pixel
 * @param {string} [scene] name of what it shows
 * @returns {Promise<string>} the file's name
 */
export async function save({ width, height, data }, scene = 'scene') {
  const canvas = new OffscreenCanvas(width, height);
  canvas.getContext('2d').putImageData(new ImageData(new Uint8ClampedArray(data), width, height), 0, 0);
  const address = URL.createObjectURL(await canvas.convertToBlob({ type: 'image/png' }));
  const link = document.createElement('a');
  link.href = address;
  link.download = `${scene.replace(/\.[^.]*$/, '')}.png`;
  link.click();
  // The download has begun by then.
  setTimeout(() => URL.revokeObjectURL(address), 10_000);
  return link.download;
}
