#!/usr/bin/env python3
"""Compares lexi_tool, the decoder of lexi.h, with the program.

    python3 reference/check.py LEXISPLAT [--mutations 300] [--seed 0] [--keep FOLDER] FILE.lexi ...

LEXISPLAT is the program. Needs a C compiler, cc, and NumPy. The tool is built with sanitisers. Each file is decoded
whole and from its first 15, 40, 70 and 95 percent: both have to accept or refuse it, the integers of every range have
the CRC-32 of the index, scales, SH-rest and extras are the same, and all else is within twice the bounds of
docs/FORMAT.md. Then so many files are damaged and sealed again with right checksums. Both have to accept or refuse
these too, and what both accept is compared. The program has to say so of a first part in which no base is whole. --keep
keeps files on which they disagree.
"""

import argparse
import json
import random
import re
import struct
import subprocess
import sys
import tempfile
from pathlib import Path
from zlib import crc32

import numpy as np

BUILD = "cc -std=c99 -Wall -Wextra -Werror -pedantic -O1 -g -fsanitize=address,undefined -fno-sanitize-recover".split()
TYPES = {"char": "i1", "uchar": "u1", "short": "<i2", "ushort": "<u2", "int": "<i4", "uint": "<u4", "float": "<f4",
         "double": "<f8"}
ODD = ["", "0", "1", "-1", "-0", "01", "+1", "1.5", "1e3", "1e400", "1e-400", " 1", "256", "4294967295",
       "18446744073709551615", "18446744073709551616", "3e2", "0e0", "NaN", "true", "false", "null", "[]", "{}",
       "[1,2,3]", "[1,2]", '["a"]', '{"a":1,"a":2}', '{"a":1}', "lexi", "packed", "f16", "paper", "x" * 300,
       "\u00e9\u2028", "[" * 40, *("[" * n + "]" * n for n in (32, 33))]
DTYPES = ["U8", "I8", "F32", "F64", "BOOL", "BF16", "u8", "F4", "F8_E5M2", "C64", ""]
NAMES = ["x-a", "x-", "extra.a", "extra.x", "extra.f_rest_7", "extra.\u2003", "extra.", "y", "normal"]
EMPTY = "no Gaussian is whole in the first part"      # what the program says of a scene of no Gaussians


def read_ply(path):
    """Return the rows of a little-endian PLY of one element."""
    data = path.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    words = [line.split() for line in data[:end].decode().splitlines()]
    count = next(int(w[2]) for w in words if w[:2] == ["element", "vertex"])
    return np.frombuffer(data[end:], np.dtype([(w[2], TYPES[w[1]]) for w in words if w[0] == "property"]), count)


class File:
    """A .lexi file in pieces that can be changed and sealed again."""

    def __init__(self, data):
        length = int.from_bytes(data[:8], "little")
        self.text, self.data = data[8 : 8 + length], bytearray(data[8 + length :])
        self.header = json.loads(self.text)
        self.spans = {k: v["data_offsets"] for k, v in self.header.items() if k != "__metadata__"}

    def ranges(self):
        """Return offsets of the CRC-32s in the head, and begins and ends of ranges in the data; and
        the numbers from origin to dc_turn."""
        begin, end = self.spans["packed.head"]
        head, at = bytes(self.data[begin:end]), 4

        def varint():
            nonlocal at
            x = shift = 0
            while True:
                x |= (head[at] & 127) << shift
                shift, at = shift + 7, at + 1
                if head[at - 1] < 128:
                    return x

        varint()
        parts, points, interim = head[at] >> 4 & 3, head[at] & 15, head[at + 1] >> 7
        at += 2 + max(parts - 1, 0)
        for _ in range(3 * interim):
            varint()
        grid = struct.unpack_from("<8f4h", head, at)
        at += 32 + 8 + (4 + 9 * points if points else 0) + 15
        for _ in range(3):
            length = varint()
            at += length
        layers, is_sorted = head[at] & 127, head[at] >> 7
        finer = head[at + 1 : at + 1 + layers]
        at += 1 + layers
        count, total, found, offset = varint(), 0, [], self.spans["packed.data"][0]
        for _ in range(count):
            layer, at = head[at], at + 1
            varint(), varint()
            at += 12 * (count > 1)
            total += 1 + finer[layer] + parts + (interim and layer < layers - 1)
        for _ in range(total):
            if not is_sorted:
                varint()
                at += 1
            size = varint()
            found.append((begin + at, offset, offset + size))
            at, offset = at + 8, offset + size
        return found, grid

    def seal(self):
        """Return the file with right checksums, as far as it can still be read."""
        text = self.text
        try:
            for crc, begin, end in self.ranges()[0] if "packed.head" in self.spans else []:
                self.data[crc : crc + 4] = crc32(self.data[begin:end]).to_bytes(4, "little")
        except IndexError:
            pass
        for name, (begin, end) in self.spans.items():
            new = b"%08x" % crc32(self.data[begin:end])
            at = text.find(b'\\"%s\\":\\"' % name.encode())
            if at >= 0:
                at += len(name.encode()) + 7
                text = text[:at] + new + text[at + 8 :]
        text = len(text).to_bytes(8, "little") + text
        if "packed.head" in self.spans:
            begin, end = self.spans["packed.head"]
            self.data[begin : begin + 4] = crc32(self.data[begin + 4 : end], crc32(text)).to_bytes(4, "little")
        elif "checksum.header" in self.spans:
            begin = self.spans["checksum.header"][0]
            self.data[begin : begin + 4] = crc32(text).to_bytes(4, "little")
        return text + bytes(self.data)


def mutated(data, random):
    """Return the file with one or two changes, and words on these."""
    file, words = File(data), []
    for _ in range(random.choice([1, 1, 2])):
        kind = random.choice(["byte"] * 3 + ["bytes"] + ["text", "metadata", "header"] * 2)
        words.append(kind)
        if kind in ("byte", "bytes"):           # small tensors as often as large ones
            begin, end = random.choice([s for s in file.spans.values() if s[0] < s[1]])
            for _ in range(1 if kind == "byte" else 8):
                at = random.randrange(begin, end)
                file.data[at] = random.choice([random.randrange(256), file.data[at] ^ 1 << random.randrange(8), 0, 255])
        elif kind == "text":
            at, text = random.randrange(len(file.text)), bytearray(file.text)
            text[at] = random.choice([random.randrange(256), text[at] ^ 1, random.choice(b'0123456789"\\{}[],:-.eE ')])
            file.text = bytes(text)
        else:
            metadata, tensors = file.header.get("__metadata__", {}), [k for k in file.header if k != "__metadata__"]
            if kind == "metadata":
                key = random.choice([*metadata, "seed", "removed", "tolerance", "target", "reached", "offset", "max_nonzeros"])
                if random.randrange(5) == 0:
                    metadata.pop(key, None)
                else:
                    old = metadata.get(key, "1")
                    near = [old + " ", old[:-1], old.replace("1", "2"), old.replace(":", ":1"), old.upper()]
                    near += [old[:1] + f'"x":{"[" * n}{"]" * n},' + old[1:] for n in (31, 32) if old[:1] == "{"]
                    metadata[key] = random.choice(ODD + near)
            else:
                name = random.choice(tensors)
                entry = file.header[name]
                what = random.randrange(8)
                if what == 0:
                    entry["dtype"] = random.choice(DTYPES)
                elif what == 1:
                    shape = entry["shape"]
                    entry["shape"] = random.choice([[], [0], shape + [1], [1] + shape, shape[::-1], [2**63, 2]])
                elif what == 2:
                    entry["data_offsets"] = [max(x + random.choice([0, -1, 1]), 0) for x in entry["data_offsets"]]
                elif what == 3:
                    file.header[random.choice(NAMES)] = file.header.pop(name)
                elif what == 4:
                    new = {"dtype": random.choice(DTYPES), "shape": [0], "data_offsets": [0, 0]}
                    file.header[random.choice(NAMES)] = new
                elif what == 5:
                    entry["more"] = random.choice([1, json.loads("[" * 30 + "]" * 30), json.loads("[" * 31 + "]" * 31)])
                elif what == 6:
                    file.header = dict(sorted(file.header.items(), key=lambda _: random.random()))
                else:
                    del file.header[name]
            separators = random.choice([(",", ":"), (", ", ": ")])
            file.text = json.dumps(file.header, ensure_ascii=random.random() < 0.5, separators=separators).encode()
            if random.randrange(4) == 0:
                file.text += random.choice([b" ", b"\n", b"  \t", b"\0", b"x"])
    data = file.seal()
    if random.randrange(12) == 0:
        data = data[: random.randrange(len(data) + 1)]
        words.append("cut")
    return data, "+".join(words)


def least_products(rows, rest, mean, turn):
    """Return what the sums of products of base colours are at least: those with axes and those with SH-rest."""
    w, x, y, z = (float(v) for v in turn)
    axes = np.array([[w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z]])
    axes /= w * w + x * x + y * y + z * z
    sh = np.zeros((len(rows), 3))
    for k, name in enumerate(rest):
        sh[:, 3 * k // len(rest)] += 3 * abs(rows[name].astype(np.float64))
    values = np.stack([rows[f"f_dc_{k}"].astype(np.float64) for k in range(3)], 1) - mean
    least = np.maximum(abs(values @ axes.T) - sh @ abs(axes).T, 0)     # SH-rest takes at most so much away
    return np.maximum(sh + least @ abs(axes), abs(values))


class Comparison:
    def __init__(self, program, folder):
        self.program, self.folder, self.tool = program, folder, folder / "lexi_tool"
        subprocess.run([*BUILD, Path(__file__).with_name("lexi_tool.c"), "-o", self.tool, "-lm"], check=True)

    def __call__(self, path, first=None, verify=True):
        """Return whether both accept a file, and what is wrong."""
        ours, theirs = self.folder / "ours.ply", self.folder / "theirs.ply"
        tool = [self.tool, path, "--ply", ours] + ["--verify"] * verify
        program = [self.program, "decompress", path, "-o", theirs, "--overwrite", "-q"]
        if first is not None:
            tool, program = tool + ["--first", str(first)], program + ["--first", str(first)]
        a, b = (subprocess.run(x, capture_output=True, text=True, errors="replace") for x in (tool, program))
        if first is not None and b.returncode == 5 and EMPTY in b.stderr and a.stdout.startswith("0 of "):
            return True, []
        if a.returncode not in (0, 4, 6) or b.returncode not in (0, 4, 6) or (a.returncode == 0) != (b.returncode == 0):
            tail = a.stderr.strip()[-1500:]
            return False, [f"tool {a.returncode} {tail} | program {b.returncode} {b.stderr.strip()}"]
        return (True, self.differences(path, read_ply(ours), read_ply(theirs))) if a.returncode == 0 else (False, [])

    @staticmethod
    def differences(path, ours, theirs):
        if dict(ours.dtype.fields).keys() != dict(theirs.dtype.fields).keys() or len(ours) != len(theirs):
            return [f"columns or rows: {len(ours)} {ours.dtype.names} {len(theirs)} {theirs.dtype.names}"]
        file, found = File(path.read_bytes()), []
        rest = [name for name in ours.dtype.names if name.startswith("f_rest_")]
        offset = json.loads(file.header["__metadata__"].get("offset", "[0, 0, 0]"))
        if "packed.head" in file.spans:
            grid = file.ranges()[1]
            products = least_products(ours, rest, grid[5:8], grid[8:])
            mean, positions = grid[5:8], np.stack([ours[k].astype(np.float64) for k in "xyz"], 1) - offset
            cells = (positions - grid[:3]) / grid[3]
            way = np.sqrt((((cells - np.floor(cells) - 0.5) * grid[3]) ** 2).sum(1))
        else:
            mean = None
        for name in ours.dtype.names:
            a, b = (np.atleast_1d(x[name]).astype(np.float64) for x in (ours, theirs))
            if mean is None or not re.fullmatch(r"x|y|z|opacity|rot_[0-3]|f_dc_[0-2]", name):
                if ours.dtype[name] != theirs.dtype[name] or ours[name].tobytes() != theirs[name].tobytes():
                    found.append(f"{name} is not the same")
                continue
            if name in ("x", "y", "z"):                 # moves together are at least as long as the way to a centre
                k = "xyz".index(name)                   # with an offset, positions are sums in f64
                bound = 2.0**-23 * abs(positions[:, k]) + 2.0**-20 * way + (2.0**-52 * abs(a) if any(offset) else 0)
            elif name == "opacity":
                bound = 2.0**-20 * np.maximum(1, abs(a))
            elif name.startswith("f_dc_"):
                bound = 2.0**-22 * abs(mean[int(name[-1])]) + 2.0**-18 * products[:, int(name[-1])]
            else:
                bound = 2.0**-20
            if not (abs(a - b) <= 2 * bound).all():
                found.append(f"{name} is {np.max(abs(a - b) / (2 * bound + 1e-300)):.3g} of what is allowed")
        return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--mutations", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path)
    args = parser.parse_args()
    wrong, accepted = 0, 0
    with tempfile.TemporaryDirectory() as folder:
        compare = Comparison(args.program, Path(folder))
        for path in args.files:
            size, whole = path.stat().st_size, 0
            for percent in (100, 15, 40, 70, 95):
                both, found = compare(path, None if percent == 100 else size * percent // 100)
                wrong, whole = wrong + bool(found), whole + both
                for text in found:
                    print(f"{path.name} {percent} %: {text}")
            print(f"{path.name}: {whole} of 5 accepted")
        source = random.Random(args.seed)
        for k in range(args.mutations):
            path = source.choice(args.files)
            data, words = mutated(path.read_bytes(), source)
            damaged = Path(folder) / f"{path.stem}.{args.seed}.{k}.lexi"
            damaged.write_bytes(data)
            first = source.choice([None, None, None, source.randrange(1, max(len(data), 2))])
            both, found = compare(damaged, first, verify=False)
            accepted, wrong = accepted + both, wrong + bool(found)
            for text in found:
                print(f"{damaged.name} ({words}, first {first}): {text}")
            if found and args.keep:
                args.keep.mkdir(parents=True, exist_ok=True)
                (args.keep / damaged.name).write_bytes(data)
            damaged.unlink()
        print(f"{args.mutations} damaged files, {accepted} accepted by both; {wrong} disagreements")
    sys.exit(wrong > 0)


if __name__ == "__main__":
    main()
