// The readers of npm's packages, for formats_beside_peers.py and peers.py. PACKAGES is a folder `node_modules`.
//
//   node peer_reader.mjs PACKAGES versions
//   node peer_reader.mjs PACKAGES read PEER FILE OUT.ply    PEER is three, gaussian-splats-3d or @adobe/spz
//   node peer_reader.mjs PACKAGES time PEER FILE ROUNDS     or splat-transform; seconds of the fastest round, and Gaussians
//   node peer_reader.mjs PACKAGES ksplat FILE.ply OUT.ksplat LEVEL DEGREE
//   node peer_reader.mjs PACKAGES spz FILE.ply OUT.spz SH1 REST    by @adobe/spz, with so many bits for SH of degree 1
//                                                          and above it
//
// three keeps covariances instead of scales and rotations, and colours of 8 bits: its OUT.ply has the properties cov_0 to
// cov_5, red, green, blue and alpha. All that is written is what the reader gave, in its own axes.

import fs from "node:fs";
import path from "node:path";
import { pathToFileURL } from "node:url";

const [packages, task, ...words] = process.argv.slice(2);
const load = (name) => import(pathToFileURL(path.resolve(packages, name)).href);
const bufferOf = (file) => {
    const bytes = fs.readFileSync(file);
    return bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);
};
async function gaussianSplats3d() {
    // It waits with it between steps. Others would take this for a browser.
    globalThis.window = globalThis;
    return load("@mkkellogg/gaussian-splats-3d/build/gaussian-splats-3d.module.js");
}
// SH coefficients of one channel above degree 0, by degree.
const REST = [0, 3, 8, 15];

// The columns of a binary little-endian PLY of floats, by name.
function readPly(file) {
    const bytes = fs.readFileSync(file);
    const end = bytes.indexOf("end_header\n") + "end_header\n".length;
    const lines = bytes.toString("latin1", 0, end).split("\n").map((line) => line.trim().split(" "));
    const count = Number(lines.find((words) => words[0] === "element")[2]);
    const names = lines.filter((words) => words[0] === "property").map((words) => words[2]);
    const rows = new Float32Array(bytes.buffer.slice(bytes.byteOffset + end, bytes.byteOffset + end + 4 * count * names.length));
    const columns = (...wanted) => {
        const at = wanted.map((name) => names.indexOf(name)), out = new Float32Array(count * at.length);
        for (let i = 0; i < count; i++) for (let k = 0; k < at.length; k++) out[i * at.length + k] = rows[i * names.length + at[k]];
        return out;
    };
    return { count, names, columns };
}

const adobe = async () => (await load("@adobe/spz/dist/spz.js")).default();

async function writeSpz(file, out, sh1Bits, shRestBits) {
    const spz = await adobe();
    const { count, names, columns } = readPly(file);
    const per = names.filter((name) => name.startsWith("f_rest_")).length / 3;
    const coefficients = Array.from({ length: 3 * per }, (_, k) => `f_rest_${(k % 3) * per + Math.floor(k / 3)}`);
    const cloud = {
        numPoints: count, shDegree: REST.indexOf(per), antialiased: false, extensions: [],
        positions: columns("x", "y", "z"), scales: columns("scale_0", "scale_1", "scale_2"),
        rotations: columns("rot_1", "rot_2", "rot_3", "rot_0"), alphas: columns("opacity"),
        colors: columns("f_dc_0", "f_dc_1", "f_dc_2"), sh: columns(...coefficients),
    };
    const version = spz.LATEST_SPZ_HEADER_VERSION;
    fs.writeFileSync(out, spz.saveSpzToBuffer(cloud, { version, from: spz.CoordinateSystem.RDF, sh1Bits, shRestBits }));
}

function dumpCloud(cloud, out) {
    const per = REST[cloud.shDegree];
    const names = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", ...restNames(per), "opacity", "scale_0", "scale_1", "scale_2"];
    writePly(out, [...names, "rot_0", "rot_1", "rot_2", "rot_3"], cloud.numPoints, (i, row) => {
        row.set(cloud.positions.subarray(3 * i, 3 * i + 3));
        row.set(cloud.colors.subarray(3 * i, 3 * i + 3), 3);
        for (let k = 0; k < per; k++) for (let c = 0; c < 3; c++) row[6 + c * per + k] = cloud.sh[3 * (i * per + k) + c];
        row[6 + 3 * per] = cloud.alphas[i];
        row.set(cloud.scales.subarray(3 * i, 3 * i + 3), 7 + 3 * per);
        const [x, y, z, w] = cloud.rotations.subarray(4 * i, 4 * i + 4);
        row.set([w, x, y, z], 10 + 3 * per);
    });
}

function writePly(file, names, count, fill) {
    const lines = names.map((name) => `property float ${name}\n`).join("");
    const rows = new Float32Array(count * names.length);
    for (let i = 0; i < count; i++) fill(i, rows.subarray(i * names.length, (i + 1) * names.length));
    fs.writeFileSync(file, `ply\nformat binary_little_endian 1.0\nelement vertex ${count}\n${lines}end_header\n`);
    fs.appendFileSync(file, new Uint8Array(rows.buffer));
}

const restNames = (per) => Array.from({ length: 3 * per }, (_, k) => `f_rest_${k}`);

// A function that reads the bytes again each time, and gives the number of Gaussians and what was read.
async function reader(peer, file) {
    const kind = path.extname(file);
    const buffer = bufferOf(file);
    if (peer === "splat-transform") {
        const { readFile, getInputFormat, MemoryReadFileSystem } = await load("@playcanvas/splat-transform/dist/index.mjs");
        const fileSystem = new MemoryReadFileSystem();
        fileSystem.set(file, new Uint8Array(buffer));
        const inputFormat = getInputFormat(file);
        return async () => {
            const [table] = await readFile({ filename: file, inputFormat, options: {}, params: [], fileSystem });
            return { count: table.numRows };
        };
    }
    if (peer === "@adobe/spz") {
        const spz = await adobe();
        return async () => {
            const cloud = spz.loadSpzFromBuffer(new Uint8Array(buffer), { to: spz.CoordinateSystem.RDF });
            return { count: cloud.numPoints, cloud };
        };
    }
    if (peer === "three" && kind === ".glb") {
        const { GLTFLoader } = await load("three/examples/jsm/loaders/GLTFLoader.js");
        const name = "GLTFGaussianSplatLoaderExtension";
        const Extension = (await load(`three/examples/jsm/loaders/${name}.js`))[name];
        return async () => {
            const loader = new GLTFLoader().register((parser) => new Extension(parser));
            const { scene } = await loader.parseAsync(buffer, "");
            let geometry;
            scene.traverse((node) => (geometry ??= node.splatGeometry));
            return { count: geometry.attributes.position.count, geometry };
        };
    }
    if (peer === "three") {
        const name = { ".spz": "SPZLoader", ".splat": "SPLATLoader", ".ksplat": "KSPLATLoader", ".ply": "GaussianSplatPLYLoader" }[kind];
        const Loader = (await load(`three/examples/jsm/loaders/${name}.js`))[name];
        return async () => {
            const geometry = await new Loader().parse(buffer);
            return { count: geometry.attributes.position.count, geometry };
        };
    }
    const theirs = await gaussianSplats3d();
    // Not optimised: nothing is sorted or left out. A .splat would be sorted all the same, so its parser is called alone.
    const readers = {
        ".spz": () => theirs.SpzLoader.loadFromFileData(new Uint8Array(buffer), 1, 0, false, 2),
        ".splat": () => theirs.SplatParser.parseStandardSplatToUncompressedSplatArray(buffer),
        ".ksplat": () => theirs.KSplatLoader.loadFromFileData(buffer),
        ".ply": () => theirs.PlyLoader.loadFromFileData(buffer, 0, 0, false, 2),
    }[kind];
    return async () => {
        const splats = await readers();
        return { count: splats.splatCount, splats };
    };
}

async function dumpThree(geometry, out) {
    const { position, covariance, color } = geometry.attributes;
    // The band's bytes of one Gaussian: coefficient by coefficient with the colour inside.
    const bands = [1, 2, 3].map((l) => geometry.attributes[`sphericalHarmonics${l}`]).filter(Boolean);
    const per = REST[bands.length];
    const bytes = bands.map((band) => new Uint8Array(band.array.buffer, band.array.byteOffset, band.array.byteLength));
    const names = ["x", "y", "z", ...[0, 1, 2, 3, 4, 5].map((k) => `cov_${k}`), "red", "green", "blue", "alpha", ...restNames(per)];
    writePly(out, names, position.count, (i, row) => {
        row.set(position.array.subarray(3 * i, 3 * i + 3));
        row.set(covariance.array.subarray(6 * i, 6 * i + 6), 3);
        row.set(color.array.subarray(4 * i, 4 * i + 4), 9);
        bands.forEach((band, l) => {
            const from = i * band.itemSize * 4;
            for (let k = 0; k < 2 * l + 3; k++) {
                for (let c = 0; c < 3; c++) row[13 + c * per + REST[l] + k] = (bytes[l][from + 3 * k + c] - 128) / 128;
            }
        });
    });
}

const SPLAT_NAMES = [
    ...["x", "y", "z", "red", "green", "blue", "alpha"],
    ...["scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"],
];

function dumpArray(array, out) {
    const at = array.constructor.OFFSET;
    const fields = [at.X, at.Y, at.Z, at.FDC0, at.FDC1, at.FDC2, at.OPACITY];
    const [scales, turns] = [[at.SCALE0, at.SCALE1, at.SCALE2], [at.ROTATION0, at.ROTATION1, at.ROTATION2, at.ROTATION3]];
    writePly(out, SPLAT_NAMES, array.splatCount, (i, row) => {
        const splat = array.getSplat(i);
        row.set([...fields.map((k) => splat[k]), ...scales.map((k) => Math.log(splat[k])), ...turns.map((k) => splat[k])]);
    });
}

async function dumpSplats(splats, out) {
    if (splats.splats) return dumpArray(splats, out);
    const { Vector3, Quaternion, Vector4 } = await load("three/build/three.module.js");
    const degree = splats.getMinSphericalHarmonicsDegree();
    const per = REST[degree], count = splats.getSplatCount();
    const [centre, scale, turn, colour] = [new Vector3(), new Vector3(), new Quaternion(), new Vector4()];
    const sh = new Float32Array(count * 3 * per);
    if (degree > 0) splats.fillSphericalHarmonicsArray(sh, degree, undefined, 0, count - 1, 0, 0);
    if (splats.compressionLevel === 2) {
        // These come as bytes.
        const { minSphericalHarmonicsCoeff: low, maxSphericalHarmonicsCoeff: high } = splats;
        sh.forEach((byte, k) => (sh[k] = low + (byte / 255) * (high - low)));
    }
    const names = [...SPLAT_NAMES, ...restNames(per)];
    writePly(out, names, count, (i, row) => {
        splats.getSplatCenter(i, centre);
        splats.getSplatScaleAndRotation(i, scale, turn);
        splats.getSplatColor(i, colour);
        row.set([centre.x, centre.y, centre.z, colour.x, colour.y, colour.z, colour.w]);
        row.set([Math.log(scale.x), Math.log(scale.y), Math.log(scale.z), turn.w, turn.x, turn.y, turn.z], 7);
        for (let k = 0; k < per; k++) {
            for (let c = 0; c < 3; c++) row[14 + c * per + k] = sh[3 * (i * per + k) + c];
        }
    });
}

if (task === "versions") {
    for (const name of ["@playcanvas/splat-transform", "@adobe/spz", "three", "@mkkellogg/gaussian-splats-3d"]) {
        const file = path.resolve(packages, name, "package.json");
        if (fs.existsSync(file)) console.log(`${name} ${JSON.parse(fs.readFileSync(file)).version}`);
    }
    console.log(`node ${process.version}`);
} else if (task === "time") {
    const [peer, file, rounds] = words;
    const read = await reader(peer, file);
    let best = Infinity, count = 0;
    for (let round = 0; round < Number(rounds); round++) {
        const start = performance.now();
        ({ count } = await read());
        best = Math.min(best, (performance.now() - start) / 1000);
    }
    console.log(`${best.toFixed(4)} ${count}`);
} else if (task === "read") {
    const [peer, file, out] = words;
    const { geometry, splats, cloud } = await (await reader(peer, file))();
    await (cloud ? dumpCloud(cloud, out) : geometry ? dumpThree(geometry, out) : dumpSplats(splats, out));
} else if (task === "ksplat") {
    const [file, out, level, degree] = words;
    const { PlyParser, SplatBufferGenerator } = await gaussianSplats3d();
    const splats = PlyParser.parseToUncompressedSplatArray(bufferOf(file), Number(degree));
    const made = SplatBufferGenerator.getStandardGenerator(1, Number(level)).generateFromUncompressedSplatArray(splats);
    fs.writeFileSync(out, Buffer.from(made.bufferData));
} else if (task === "spz") {
    const [file, out, first, rest] = words;
    await writeSpz(file, out, Number(first), Number(rest));
} else {
    console.error("versions | read PEER FILE OUT.ply | time PEER FILE ROUNDS | ksplat FILE.ply OUT.ksplat LEVEL DEGREE | spz FILE.ply OUT.spz SH1 REST");
    process.exit(2);
}
