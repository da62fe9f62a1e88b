#!/usr/bin/env python3
"""Decodes .lexi files twice, by decode_lexi.py and by the program, and compares them.

    python3 scripts/check_decoder.py LEXISPLAT FILE.lexi ...

LEXISPLAT is the program. Needs NumPy. Of exact layouts every bit is the same. Of packed files the integers of every
range have the CRC-32 of the index, scales, SH-rest and extras are the same, and all else is within the bounds of
docs/FORMAT.md. Where FILE.trace lies beside FILE.lexi, `decode_lexi.py --trace 3` prints just that.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

sys.dont_write_bytecode = True  # no __pycache__ in the working tree
from decode_lexi import decode, in_source_order  # noqa: E402

TYPES = {"char": "i1", "uchar": "u1", "short": "<i2", "ushort": "<u2", "int": "<i4", "uint": "<u4", "float": "<f4",
         "double": "<f8"}
COLUMNS = {
    "position": ("x", "y", "z"),
    "dc": ("f_dc_0", "f_dc_1", "f_dc_2"),
    "opacity": ("opacity",),
    "scale": ("scale_0", "scale_1", "scale_2"),
    "rotation": ("rot_0", "rot_1", "rot_2", "rot_3"),
}


def read_ply(path):
    """Return the columns of a little-endian PLY of one element by name."""
    data = path.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    words = [line.split() for line in data[:end].decode().splitlines()]
    count = next(int(w[2]) for w in words if w[:2] == ["element", "vertex"])
    fields = [(w[2], TYPES[w[1]]) for w in words if w[0] == "property"]
    return np.frombuffer(data[end:], np.dtype(fields), count)


def differences(file, program, folder):
    """Return what is wrong, and a few words on what was compared."""
    ply = Path(folder) / "decoded.ply"
    subprocess.run([program, "decompress", "--quiet", "--overwrite", file, "-o", ply], check=True, stderr=subprocess.DEVNULL)
    theirs = read_ply(ply)
    _, ours = decode(Path(file).read_bytes())
    ours = in_source_order(ours)
    found, words = [], "the same"
    if "integers" in ours:
        ranges = ours["integers"]
        found = [f"integers of range {k}" for k, (_, right) in sorted(ranges.items()) if not right]
        found += [f"range {k} was not decoded" for k in sorted(set(ours["ranges"]) - set(ranges))]
        words = f"{len(ranges)} ranges, {sum(n for n, _ in ranges.values())} integers"
    trace = Path(file).with_suffix(".trace")
    if trace.exists():
        script = Path(__file__).with_name("decode_lexi.py")
        printed = subprocess.run([sys.executable, script, file, "--trace", "3"], check=True, capture_output=True, text=True)
        found += [] if printed.stdout == trace.read_text() else ["its trace"]
        words += ", its trace"
    if len(theirs) != len(ours["position"]):
        return found + ["number of Gaussians"], words
    columns = dict(ours["extras"])
    columns.update({f"f_rest_{k}": ours["sh_rest"][:, k] for k in range(ours["sh_rest"].shape[1])})
    known = set(columns) | {"nx", "ny", "nz"}
    for name, parts in COLUMNS.items():
        known |= set(parts)
        if not set(parts) <= set(theirs.dtype.names):
            found.append(name)
        elif name in ours.get("ideal", {}):
            ideal, bound = (x.reshape(len(theirs), len(parts)) for x in ours["ideal"][name])
            far = abs(np.stack([theirs[p] for p in parts], 1).astype(np.float64) - ideal)
            if not (far <= bound).all():                # NaNs are not
                found.append(name)
            ratio = np.divide(far, bound, out=np.zeros_like(far), where=far > 0).max(initial=0)
            words += f", {name} {ratio:.2f}"
        else:
            values = ours[name].reshape(len(theirs), len(parts))
            columns.update({part: values[:, k] for k, part in enumerate(parts)})
    return found + sorted(set(theirs.dtype.names) - known) + [
        name for name, values in columns.items()
        if name not in theirs.dtype.names or values.tobytes() != theirs[name].tobytes()], words


def main():
    if len(sys.argv) < 3:
        sys.exit("usage: check_decoder.py LEXISPLAT FILE.lexi ...")
    bad = False
    with tempfile.TemporaryDirectory() as folder:
        for file in sys.argv[2:]:
            found, words = differences(file, sys.argv[1], folder)
            bad |= bool(found)
            print(f"{file}: {'differs in ' + ', '.join(found) if found else words}")
    sys.exit(bad)


if __name__ == "__main__":
    main()
