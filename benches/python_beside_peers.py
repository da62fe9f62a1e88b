#!/usr/bin/env python3
"""The Python package beside its peers: reading a PLY, and coding rows over a dictionary.

    python3 benches/python_beside_peers.py MODELS [--only read code memory] [--threads N] [--rounds 7] [--gaussians 1000000]

MODELS is a folder with the real models. Needs the package itself, and: pip install plyfile gsply scikit-learn spams-bin

Sections:
  read    a PLY of a million Gaussians (bonsai-3dgs.ply, tiled by tile.py), in the page cache, to six contiguous float32
          arrays: median seconds of 7 rounds, in which every reader has its turn
  code    leica-brush.ply's SH over the same 90 atoms to the same tolerance: rows a second on so many threads, and mean
          nonzeros. SPAMS' `omp`, which chooses as OLS does, and scikit-learn's `orthogonal_mp` take the squared norm
  learn   the same rows: a dictionary by each, then coded by our pursuit: seconds to learn and mean nonzeros
  memory  the largest resident memory of a process that reads the million, beside that of its arrays
"""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from importlib.metadata import version
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
TOLERANCE = 0.1  # the paper's
ATOMS = 90
NAMES = ["means", "scales", "quats", "opacities", "sh0", "shN"]


def by_lexisplat(path):
    import lexisplat

    return lexisplat.load(path, contiguous=True).to_dict()


def by_plyfile(path):
    from plyfile import PlyData

    rows = PlyData.read(path)["vertex"].data

    def columns(*names):
        return np.stack([rows[name] for name in names], axis=1).astype(np.float32, copy=False)

    rest = [name for name in rows.dtype.names if name.startswith("f_rest_")]
    shN = columns(*rest).reshape(len(rows), 3, -1).transpose(0, 2, 1)
    return {
        "means": columns("x", "y", "z"),
        "scales": columns("scale_0", "scale_1", "scale_2"),
        "quats": columns("rot_0", "rot_1", "rot_2", "rot_3"),
        "opacities": np.ascontiguousarray(rows["opacity"], np.float32),
        "sh0": columns("f_dc_0", "f_dc_1", "f_dc_2")[:, None],
        "shN": np.ascontiguousarray(shN),
    }


def by_gsply(path):
    import gsply

    data = gsply.plyread(str(path))
    arrays = {"means": data.means, "scales": data.scales, "quats": data.quats, "opacities": data.opacities}
    arrays |= {"sh0": data.sh0[:, None], "shN": data.shN}
    return {name: np.ascontiguousarray(values, np.float32) for name, values in arrays.items()}


def read(models, count, rounds, folder):
    path = tile(models, count, folder)
    readers = {"lexisplat": by_lexisplat, "plyfile": by_plyfile, "gsply": by_gsply}
    times = {name: [] for name in readers}
    arrays = {name: reader(path) for name, reader in readers.items()}
    reference = arrays["plyfile"]
    for name, found in arrays.items():
        for key in NAMES:
            assert found[key].flags.c_contiguous and found[key].dtype == np.float32, (name, key)
            assert np.array_equal(found[key], reference[key]), (name, key)
    del arrays, reference
    for _ in range(rounds):
        for name, reader in readers.items():
            clock = time.perf_counter()
            reader(path)
            times[name].append(time.perf_counter() - clock)
    print(f"\n| reader | seconds for {count:,} Gaussians, median of {rounds} | beside ours |\n|---|---|---|")
    ours = statistics.median(times["lexisplat"])
    for name, taken in times.items():
        median = statistics.median(taken)
        print(f"| {name} {version(name)} | {median:.3f} | {median / ours:.1f} |")


def tile(models, count, folder):
    path = Path(folder) / "large.ply"
    if not path.exists():
        import lexisplat

        source = lexisplat.load(models / "bonsai-3dgs.ply")
        times = -(-count // len(source))
        arrays = {name: np.concatenate([getattr(source, name)] * times)[:count] for name in NAMES}
        lexisplat.save(path, lexisplat.Splats(**arrays))
    path.read_bytes()
    return path


def rows_of(models):
    import lexisplat

    return np.ascontiguousarray(lexisplat.load(models / "leica-brush.ply").shN.transpose(0, 2, 1)).reshape(-1, 45)


def coders(X, components, threads):
    import spams
    from sklearn.linear_model import orthogonal_mp

    import lexisplat

    def ours(pursuit):
        learner = lexisplat.DictionaryLearner(ATOMS, TOLERANCE, pursuit=pursuit).fit(X[:2])
        learner.components_ = components
        return lambda: learner.transform(X)

    # Each has its input in the form that it takes without a conversion.
    columns, atoms = np.asfortranarray(X.T), np.asfortranarray(components.T)
    doubles, double_atoms = columns.astype(np.float64), atoms.astype(np.float64)
    return {
        f"lexisplat {version('lexisplat')}, OLS": ours("ols"),
        f"lexisplat {version('lexisplat')}, OMP": ours("omp"),
        f"SPAMS {version('spams-bin')}": lambda: spams.omp(columns, atoms, eps=TOLERANCE**2, numThreads=threads).T,
        # SparseCoder takes no tolerance for OMP; what it calls does.
        f"scikit-learn {version('scikit-learn')}, OMP": lambda: orthogonal_mp(
            double_atoms, doubles, tol=TOLERANCE**2, precompute=True
        ).T,
    }


def code(models, rounds, threads):
    import lexisplat

    X = rows_of(models)
    components = lexisplat.DictionaryLearner(ATOMS, TOLERANCE).fit(X).components_
    print(f"\n| coder, {threads} threads | rows a second | times ours is faster | mean nonzeros | largest error |\n|---|---|---|---|---|")
    base = None
    for name, coder in coders(X, components, threads).items():
        taken = []
        for _ in range(1 if "scikit" in name else rounds):
            clock = time.perf_counter()
            codes = coder()
            taken.append(time.perf_counter() - clock)
        median = statistics.median(taken)
        base = base or median
        dense = codes.toarray() if hasattr(codes, "toarray") else np.asarray(codes)
        error = np.linalg.norm(dense.astype(np.float64) @ components - X, axis=1).max()
        nonzeros = (dense != 0).sum(1).mean()
        print(f"| {name} | {len(X) / median:,.0f} | {median / base:.1f} | {nonzeros:.3f} | {error:.4f} |", flush=True)


def learn(models):
    import spams
    from sklearn.decomposition import MiniBatchDictionaryLearning

    import lexisplat

    X = rows_of(models)

    def ours():
        return lexisplat.DictionaryLearner(ATOMS, TOLERANCE).fit(X).components_

    def by_spams():
        signals = np.asfortranarray(X.T.astype(np.float64))
        # Mode 3: least squared error with at most lambda1 nonzeros; 4 is near what the tolerance gives.
        D = spams.trainDL(signals, K=ATOMS, mode=3, lambda1=4, iter=300, numThreads=1, verbose=False)
        return D.T

    def sklearn():
        learner = MiniBatchDictionaryLearning(
            ATOMS, transform_algorithm="omp", fit_algorithm="lars", alpha=0.05, batch_size=256, random_state=0
        )
        return learner.fit(X.astype(np.float64)).components_

    print("\n| learner | seconds | mean nonzeros, coded by our OLS to the same tolerance |\n|---|---|---|")
    for name, learner in (("lexisplat", ours), ("SPAMS, 300 rounds", by_spams), ("scikit-learn, mini-batches", sklearn)):
        clock = time.perf_counter()
        components = np.ascontiguousarray(learner(), np.float32)
        taken = time.perf_counter() - clock
        components /= np.maximum(np.linalg.norm(components, axis=1, keepdims=True), 1e-12)
        components[np.linalg.norm(components, axis=1) < 0.5, 0] = 1
        coder = lexisplat.DictionaryLearner(ATOMS, TOLERANCE).fit(X[:2])
        coder.components_ = components
        codes = coder.transform(X)
        print(f"| {name} | {taken:.1f} | {codes.nnz / len(X):.3f} |", flush=True)


MEASURE = """
import sys, lexisplat

def peak():
    # ru_maxrss begins with what the parent had.
    with open("/proc/self/status") as status:
        return next(int(line.split()[1]) for line in status if line.startswith("VmHWM:"))

before = peak()
splats = lexisplat.load(sys.argv[1])
read = peak()
lexisplat.save(sys.argv[2], splats)
print(before, read, peak(), splats.nbytes // 1024)
"""


def memory(models, count, folder):
    path = tile(models, count, folder)
    out = Path(folder) / "out.ply"
    done = subprocess.run([sys.executable, "-c", MEASURE, path, out], capture_output=True, text=True, check=True)
    before, after_read, after_save, arrays = (int(word) / 1024 for word in done.stdout.split())
    print(f"\n| largest resident memory, {count:,} Gaussians | MiB |\n|---|---|")
    print(f"| the arrays | {arrays:.0f} |\n| the interpreter with NumPy and the package | {before:.0f} |")
    print(f"| after load, with the pages of the mapped file | {after_read:.0f} |\n| after save, with one copy | {after_save:.0f} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("models", type=Path)
    parser.add_argument("--only", nargs="+", choices=["read", "code", "learn", "memory"])
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--gaussians", type=int, default=1_000_000)
    args = parser.parse_args()
    # Before anything is imported that reads them.
    for name in ("RAYON_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = str(args.threads)
    with tempfile.TemporaryDirectory() as folder:
        for section in args.only or ["read", "code", "learn", "memory"]:
            print(f"\n## {section}", flush=True)
            if section == "read":
                read(args.models, args.gaussians, args.rounds, folder)
            elif section == "code":
                code(args.models, args.rounds, args.threads)
            elif section == "learn":
                learn(args.models)
            else:
                memory(args.models, args.gaussians, folder)


if __name__ == "__main__":
    main()
