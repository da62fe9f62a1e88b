// A download that stops on the way, so that a test sees what is drawn until then.

/**
 * Holds what is fetched from an address after its first bytes, once.
 * @param {string} address
 * @param {number} bytes that come at once
 * @returns {() => void} lets the rest come
 */
export function held(address, bytes) {
  const { fetch } = window;
  let release;
  const released = new Promise((resolve) => (release = resolve));
  window.fetch = async (url, options) => {
    if (new URL(url, location.href).pathname !== address) return fetch(url, options);
    window.fetch = fetch;
    const whole = new Uint8Array(await (await fetch(url)).arrayBuffer());
    const start = async (controller) => {
      controller.enqueue(whole.subarray(0, bytes));
      await released;
      controller.enqueue(whole.subarray(bytes));
      controller.close();
    };
    return new Response(new ReadableStream({ start }), { headers: { 'content-length': whole.length } });
  };
  return release;
}
