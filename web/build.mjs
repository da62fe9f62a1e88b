/**
 * Builds the WebAssembly of the npm package: `node build.mjs [decoder] [files] [processor] [viewer]`, all without arguments.
 *
 * It needs the Rust toolchain with the target wasm32-unknown-unknown. With the npm package `binaryen` in node_modules, or in
 * the folder that LEXISPLAT_NPM names, the result is optimised further.
 */

import { spawnSync } from 'node:child_process';
import { existsSync, mkdirSync, readFileSync, statSync, writeFileSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { gzipSync } from 'node:zlib';

const web = dirname(fileURLToPath(import.meta.url));
const root = dirname(web);
const target = process.env.CARGO_TARGET_DIR ?? join(root, 'target');
const modules = process.env.LEXISPLAT_NPM ?? join(web, 'node_modules');

/** The features of WebAssembly that a build needs; every browser with WebGPU has it, and Node since version 16. */
const FEATURES = '-Ctarget-feature=+simd128,+bulk-memory,+nontrapping-fptoint,+sign-ext,+mutable-globals';
/** The same for wasm-opt, and what wasm-bindgen uses. All its features at once make files that engines do not read yet. */
const ENABLED = ['simd', 'bulk-memory', 'bulk-memory-opt', 'nontrapping-float-to-int', 'sign-ext', 'mutable-globals', 'reference-types', 'multivalue'].map((f) => `--enable-${f}`);
/** Comments of the JavaScript that wasm-bindgen writes: each starts and ends a line. */
const COMMENTS = /^ *\/\*\*[^]*?\*\/\n/gm;
/** Most bytes of the decoder and its JavaScript after gzip -9. */
const MOST_DECODER = 150_000;

/**
 * The builds, their features of the crate, what wasm-opt does, and what cargo is told besides: `decoder` decodes packed files,
 * `files` other .lexi files, `viewer` is what the viewer is made of, and `processor` draws where there is no WebGPU.
 */
const BUILDS = {
  decoder: { features: ['feed'], optimise: ['-O3', '-Oz'] },
  files: { features: ['files'], optimise: ['-Oz'] },
  // In the viewer this crate makes pictures on the GPU, and is small. Here it draws them itself.
  processor: { features: ['processor'], optimise: ['-O3'], cargo: ['--config', 'profile.wasm.package.lexisplat-render.opt-level=2'] },
  viewer: { features: ['viewer'], optimise: ['-Oz'] },
};

function run(program, args, env = {}) {
  const { status, error } = spawnSync(program, args, { stdio: 'inherit', env: { ...process.env, ...env } });
  if (error || status !== 0) {
    console.error(`${program} ${args.join(' ')}: ${error ?? `exit code ${status}`}`);
    process.exit(1);
  }
}

function build(name) {
  const { features, optimise, cargo: more = [] } = BUILDS[name];
  const cargo = ['build', '--locked', '--profile', 'wasm', '--target', 'wasm32-unknown-unknown', '-p', 'lexisplat-web', '--lib'];
  cargo.push('--manifest-path', join(root, 'Cargo.toml'), '--target-dir', target, '--no-default-features');
  cargo.push('--features', features.join(','), ...more);
  run('cargo', cargo, { RUSTFLAGS: `${FEATURES} ${process.env.RUSTFLAGS ?? ''}`.trim() });
  const built = join(target, 'wasm32-unknown-unknown/wasm/lexisplat_web.wasm');
  const folder = join(web, 'wasm');
  mkdirSync(folder, { recursive: true });
  const bindgen = ['run', '--locked', '--quiet', '--manifest-path', join(web, 'bindgen/Cargo.toml'), '--target-dir', join(target, 'bindgen')];
  run('cargo', [...bindgen, '--', built, folder, name]);
  const wasm = join(folder, `${name}_bg.wasm`);
  const optimiser = join(modules, 'binaryen/bin/wasm-opt');
  if (existsSync(optimiser)) {
    run(process.execPath, [optimiser, wasm, '-o', wasm, ...optimise, ...ENABLED, '--strip-debug', '--strip-producers']);
  } else {
    console.warn(`${name}: not optimised further, because binaryen is not in ${modules}`);
  }
  const script = join(folder, `${name}.js`);
  // The same comments are in the types.
  writeFileSync(script, readFileSync(script, 'utf8').replace(COMMENTS, ''));
  report(name, wasm, script);
}

function report(name, ...files) {
  const bytes = files.reduce((n, file) => n + statSync(file).size, 0);
  const gzipped = files.reduce((n, file) => n + gzipSync(readFileSync(file), { level: 9 }).length, 0);
  console.log(`${name}: ${bytes} bytes, ${gzipped} after gzip -9`);
  if (name === 'decoder' && gzipped > MOST_DECODER) {
    console.error(`the decoder has more than ${MOST_DECODER} bytes after gzip -9`);
    process.exit(1);
  }
}

const names = process.argv.slice(2);
for (const name of names.length > 0 ? names : Object.keys(BUILDS)) build(name);
