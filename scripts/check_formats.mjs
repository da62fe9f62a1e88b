// Other programs open what `lexisplat convert` writes, and read the same as we do.
//
// node scripts/check_formats.mjs LEXISPLAT NODE_MODULES SCENE.ply
//
// LEXISPLAT is the program, NODE_MODULES a folder that has @playcanvas/splat-transform and gltf-validator. Exits with 1
// and says what differs.

import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { createRequire } from 'node:module';
import { tmpdir } from 'node:os';
import { join, resolve } from 'node:path';

const [program, modules, scene] = process.argv.slice(2).map((path) => resolve(path));
const splatTransform = join(modules, '@playcanvas/splat-transform/bin/cli.mjs');
const validator = createRequire(join(modules, 'x.js'))('gltf-validator');

// How alike pictures of the two readings are at least, in dB. splat-transform takes another byte of a .splat's rotations
// as 0 than its viewers do.
const ALIKE = 50;
const ALIKE_SPLAT = 30;
// The validator does not know the extension's attributes.
const NOT_KNOWN = 'MESH_PRIMITIVE_INVALID_ATTRIBUTE';

const folder = mkdtempSync(join(tmpdir(), 'formats-'));
const at = (name) => join(folder, name);
const lexisplat = (...args) => execFileSync(program, [...args, '--json'], { encoding: 'utf8' });
const faults = [];

const beside = (name, options, least) => {
    lexisplat('convert', scene, at(name), ...options);
    lexisplat('convert', at(name), at(`ours-${name}.ply`));
    execFileSync('node', [splatTransform, '-q', at(name), at(`theirs-${name}.ply`)], { stdio: 'inherit' });
    const views = ['--orbit', '2', '--width', '200', '--device', 'cpu'];
    const report = JSON.parse(lexisplat('compare', at(`ours-${name}.ply`), at(`theirs-${name}.ply`), ...views));
    const psnr = report.psnr.min ?? Infinity;
    console.log(`${name}: the worst of 2 views is ${psnr.toFixed(1)} dB alike`);
    if (!(psnr >= least)) faults.push(`${name}: ${psnr} dB, and ${least} are expected`);
};

const validate = async (name, options) => {
    lexisplat('convert', scene, at(name), ...options);
    const report = await validator.validateBytes(new Uint8Array(readFileSync(at(name))), { maxIssues: 0 });
    const errors = report.issues.messages.filter((message) => message.severity === 0);
    const others = errors.filter((error) => error.code !== NOT_KNOWN || !error.pointer.includes('/attributes/KHR_gaussian_splatting:'));
    console.log(`${name}: ${errors.length} errors of the validator, ${others.length} of them not for the extension's attributes`);
    faults.push(...others.map((error) => `${name}: ${error.pointer}: ${error.code}: ${error.message}`));
};

try {
    for (const version of [2, 3, 4]) beside(`v${version}.spz`, ['--spz-version', `${version}`], ALIKE);
    beside('a.sog', [], ALIKE);
    beside('a.compressed.ply', [], ALIKE);
    beside('a.splat', [], ALIKE_SPLAT);
    await validate('a.glb', []);
    await validate('b.glb', ['--glb-spz']);
} finally {
    rmSync(folder, { recursive: true });
}
faults.forEach((fault) => console.error(fault));
process.exit(faults.length > 0 ? 1 : 0);
