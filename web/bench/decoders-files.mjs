// The files of decoders.mjs: a scene as .lexi, SPZ, SOG and compressed.ply, and the PSNR of each against the PLY.

import { execFileSync } from 'node:child_process';
import { copyFileSync, statSync, writeFileSync, readFileSync } from 'node:fs';
import { join } from 'node:path';

// PSNR that `compress --preset balanced` aims at, dB.
const BALANCED = 40;
// Files of this difference in PSNR are taken as equal, dB.
const EQUAL = 0.5;
// Times that a matching file is made anew at most.
const TRIES = 3;
// Most bytes of what the program prints.
const MOST_PRINTED = 64 << 20;

/** Arguments of `compare` for the views. */
function viewArguments(cameras, most, path) {
  if (cameras === '-') return ['--orbit', most];
  const all = JSON.parse(readFileSync(cameras, 'utf8'));
  const test = all.filter(({ split }) => split === 'test');
  const from = test.length > 0 ? test : all;
  const count = Math.min(Number(most), from.length);
  const chosen = Array.from({ length: count }, (_, i) => from[Math.floor(((i + 0.5) * from.length) / count)]);
  writeFileSync(path, JSON.stringify(chosen));
  return ['--cameras', path, '--split', 'all'];
}

/** A .lexi whose PSNR is that of another file or a little more. */
function matching({ wanted, balanced, ply, run, at, judged }) {
  let target = BALANCED + wanted - balanced;
  let best;
  for (let i = 0; i < TRIES; i++) {
    run('compress', ply, '-o', at('matched.lexi'), '--psnr', target.toFixed(2), '--overwrite');
    const made = judged(at('matched.lexi'));
    const off = made.psnr.mean - wanted;
    const isBetter = !best || (off < 0 ? best.off < off && best.off < 0 : best.off < 0 || off < best.off);
    if (isBetter) {
      copyFileSync(made.path, at('best.lexi'));
      best = { ...made, path: at('best.lexi'), off };
    }
    if (off >= 0 && off <= EQUAL) break;
    target -= off - EQUAL / 4;
  }
  return best;
}

/**
 * @param {object} options program and ply: paths; cameras: a path or `-`; scratch: a folder; views: most of them; lexi,
 *     matched: ready files; match: whether a .lexi of the PSNR of the SPZ is made
 * @returns {Record<string, {path: string, bytes: number, gaussians: number, psnr: {mean: number, min: number}, views: number}>}
 */
export function makeFiles({ program, ply, cameras, scratch, lexi, match, matched, views: most }) {
  const run = (...args) => execFileSync(program, [...args, '--quiet'], { stdio: ['ignore', 'pipe', 'inherit'], maxBuffer: MOST_PRINTED });
  const at = (name) => join(scratch, name);
  const views = viewArguments(cameras, most, at('cameras.json'));
  const judged = (path) => {
    const { psnr, b, views: drawn } = JSON.parse(run('compare', ply, path, ...views, '--json'));
    return { path, bytes: statSync(path).size, gaussians: b.gaussians, psnr, views: drawn.length };
  };

  const files = {};
  if (!lexi) run('compress', ply, '--preset', 'balanced', '-o', at('balanced.lexi'));
  files['.lexi balanced'] = judged(lexi ?? at('balanced.lexi'));
  const converted = [['SPZ v3', 'v3.spz', '--spz-version', '3'], ['SPZ v4', 'v4.spz', '--spz-version', '4'], ['SOG', 'scene.sog'], ['compressed.ply', 'scene.compressed.ply']];
  for (const [name, file, ...options] of converted) {
    run('convert', ply, at(file), ...options);
    files[name] = judged(at(file));
  }
  const wanted = files['SPZ v4'].psnr.mean;
  const balanced = files['.lexi balanced'].psnr.mean;
  const isMade = match && Math.abs(balanced - wanted) > EQUAL;
  const equal = matched ? judged(matched) : isMade ? matching({ wanted, balanced, ply, run, at, judged }) : undefined;
  if (equal) files['.lexi as good as SPZ'] = equal;
  return files;
}
