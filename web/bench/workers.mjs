// How much faster two workers decode than one, in Node.
//
//   node web/bench/workers.mjs SCENE.lexi [ROUNDS]
//
// Each round decodes the scene with one worker and with two, which were started before. It prints the medians.

import { readFileSync } from 'node:fs';
import { open } from '../src/node/index.js';

const [scene, rounds = '5'] = process.argv.slice(2);
const bytes = readFileSync(scene);
const median = (values) => values.sort((a, b) => a - b)[values.length >> 1];
const times = new Map([[1, []], [2, []]]);
let gaussians = 0;
for (let round = 0; round < Number(rounds); round++) {
  for (const [workers, milliseconds] of times) {
    const opened = await open(bytes, { workers });
    const began = performance.now();
    gaussians = 0;
    for await (const chunk of opened.chunks()) gaussians += chunk.count;
    milliseconds.push(performance.now() - began);
    opened.close();
  }
}
const [one, two] = [...times.values()].map(median);
const rate = (milliseconds) => `${(gaussians / milliseconds / 1000).toFixed(2)} million a second`;
console.log(`${gaussians} Gaussians: one worker ${one.toFixed(0)} ms, ${rate(one)}; two ${two.toFixed(0)} ms, ${rate(two)}; ${(one / two).toFixed(2)} times`);
