// Cost of dense SH and of codes in Spark: bytes on the GPU, and the pass that makes the Gaussians of a view.
//
// LEXISPLAT_NPM=node_modules node bench/spark.mjs SCENE.lexi

import { readFileSync } from 'node:fs';
import { resolve } from 'node:path';
import { open } from 'lexisplat';
import { launch } from '../test/support/chromium.mjs';
import { openViewer, serveViewers } from '../test/support/viewers.mjs';
import { orbit } from '../test/support/views.mjs';

// Times that each is measured, in turns, and passes of each time.
const [ROUNDS, PASSES] = [3, 9];
const [lexi] = process.argv.slice(2);
const scene = await open(readFileSync(lexi), { workers: 0, shParts: 0 });
const { gaussians } = scene.header;
const [view] = orbit((await scene.all({ as: 'dense' })).positions, 1, 256);
scene.close();

const server = await serveViewers({ '/scene.lexi': resolve(lexi) });
const browser = await launch();
const viewer = await openViewer(browser, `${server.url}/test/support/spark.html`);
const found = { dense: { times: [] }, codes: { times: [] } };
for (let round = 0; round < ROUNDS; round++) {
  for (const [as, result] of Object.entries(found)) {
    await viewer.call('show', { url: '/scene.lexi', as });
    await viewer.call('draw', view);
    result.bytes = await viewer.call('bytes');
    result.times.push(...(await viewer.call('passes', PASSES)));
  }
}
console.log(`${gaussians} Gaussians`);
for (const [as, { bytes, times }] of Object.entries(found)) {
  times.sort((a, b) => a - b);
  const [least, median, most] = [times[0], times[times.length >> 1], times.at(-1)].map((time) => time.toFixed(1));
  console.log(`${as}: ${(bytes / gaussians).toFixed(1)} bytes a Gaussian, a pass takes ${median} ms (${least} to ${most})`);
}
if (viewer.faults.length > 0) console.error(viewer.faults.join('\n'));
await browser.close();
await server.close();
