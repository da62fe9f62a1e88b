// Opens bench/harness.html, the viewer without its controls.

/**
 * @param {import('playwright-core').Browser} browser
 * @param {{url: string}} server of the folder web/
 * @param {{timeout?: number}} [options] milliseconds that a call may take; 0 for as long as it takes
 * @returns {Promise<import('playwright-core').Page>} a page whose `window.bench` has begun
 */
export async function openHarness(browser, server, { timeout } = {}) {
  const page = await browser.newPage();
  page.on('pageerror', (error) => console.error(error.message));
  if (timeout !== undefined) page.setDefaultTimeout(timeout);
  await page.goto(`${server.url}/bench/harness.html`);
  await page.waitForFunction(() => document.title === 'ready');
  await page.evaluate(() => window.bench.start());
  return page;
}
