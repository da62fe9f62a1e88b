#!/usr/bin/env python3
"""Decoder of .lexi files (layouts packed, f32, f16 and paper) with NumPy alone.

It is written from docs/FORMAT.md alone; lexi3.py beside it holds what is of layout packed.
"""
import argparse
import json
import math
import re
import sys
import unicodedata
import zlib

import numpy as np

import lexi3
from lexi3 import LexiError, check

F = np.float32
MAX_HEADER = 4 << 20
PACKED = NEWEST = 3
MAX_DEPTH = 32
DTYPES = {"BOOL": "u1", "I8": "i1", "U8": "u1", "I16": "<i2", "U16": "<u2", "F16": "<f2", "BF16": "<u2", "I32": "<i4",
          "U32": "<u4", "F32": "<f4", "I64": "<i8", "U64": "<u8", "F64": "<f8"}
EXTRA_TYPES = ("I8", "U8", "I16", "U16", "I32", "U32", "F32", "F64")
# These are the properties of 3DGS, which an extra must not be called. Normals may be extras.
RESERVED = re.compile(r"x|y|z|opacity|f_dc_[0-2]|f_rest_[0-9]+|scale_[0-2]|rot_[0-3]")
INTEGER = re.compile(r"0|[1-9][0-9]*")
SUM = re.compile(r"[0-9a-f]{8}")
NUMBER = re.compile(r"-?(0|[1-9][0-9]*)(\.[0-9]+)?([eE][+-]?[0-9]+)?")

TRACE = """
A trace is of lane 0 of chunk 0 of a packed file, range by range in ascending order of kinds (0 is the base), and
in the order in which the lane is decoded. Each symbol and each piece of raw bits, of at most 16, has a line:

    RANGE GAUSSIAN STREAM CONTEXT SYMBOL STATE
    RANGE GAUSSIAN bits COUNT VALUE STATE

RANGE is the kind of the range, GAUSSIAN the number of the Gaussian in the lane, STREAM the name of the stream in
docs/FORMAT.md, and STATE the state of the lane after the step and its refill, in hexadecimal. Other numbers are decimal.
Signs of nonzeros are of several Gaussians: GAUSSIAN is then "-". Nothing is printed for other Gaussians than the first K,
though they are decoded. A piece of signs is printed if one of its signs is of the first K.
"""


# The container

def parse_json(text):
    def integer(text):
        return -0.0 if text == "-0" else int(text)          # an integer has no sign of its own at 0

    def members(pairs):
        check(len({k for k, _ in pairs}) == len(pairs), "JSON names a member twice")
        return dict(pairs)

    def constant(name):
        raise LexiError(f"{name} is not JSON")
    try:
        value = json.loads(text, object_pairs_hook=members, parse_constant=constant, parse_int=integer)
        json.dumps(value, ensure_ascii=False).encode()          # refuses lone surrogates
        inner = [value]
        for _ in range(MAX_DEPTH + 1):
            outer = [v for v in inner if isinstance(v, (dict, list))]
            inner = [v for o in outer for v in (o.values() if isinstance(o, dict) else o)]
        check(not outer, "arrays and objects of JSON are more than 32 deep")
        return value
    except (ValueError, RecursionError) as e:
        raise LexiError(f"bad JSON: {e}") from e


def read_container(data, beginning=False):
    """Return the metadata, the tensors as {name: (dtype, shape, entries)}, the bytes of the header, and where tensors lie.

    If data is the beginning of a file, it has only the entries of tensors that are whole, and what is there of
    packed.data. Of others the entries are None.
    """
    check(len(data) >= 8, "the file is too short")
    length = int.from_bytes(data[:8], "little")
    check(length <= MAX_HEADER, "the length L of the header is above 4 MiB")
    check(8 + length <= len(data), "the length L of the header goes beyond the file")
    check(data[8:9] == b"{", "byte 8 is not {")
    try:
        text = data[8:8 + length].decode("utf-8")
    except UnicodeDecodeError as e:
        raise LexiError("the header is not UTF-8") from e
    header = parse_json(text)
    check(isinstance(header, dict), "the header is no object")
    meta = header.pop("__metadata__", None)
    check(isinstance(meta, dict) and all(isinstance(v, str) for v in meta.values()), "no metadata of strings")
    body = memoryview(data)[8 + length:]
    entries = []
    for name, e in header.items():
        check(isinstance(e, dict) and set(e) >= {"dtype", "shape", "data_offsets"}, f"bad entry {name}")
        dtype, shape, ends = e["dtype"], e["shape"], e["data_offsets"]
        check(isinstance(dtype, str) and dtype in DTYPES, f"{name} is of an unknown type")
        check(all(isinstance(x, list) and all(type(v) is int and 0 <= v < 1 << 64 for v in x) for x in (shape, ends))
              and len(ends) == 2, f"bad shape or offsets of {name}")
        check(ends[1] - ends[0] == math.prod(shape) * np.dtype(DTYPES[dtype]).itemsize, f"bad size of {name}")
        entries.append((ends[0], ends[1], name, dtype, shape))
    at, tensors = 0, {}
    for begin, end, name, dtype, shape in sorted(entries):
        check(begin == at and (end <= len(body) or beginning), f"{name} leaves a hole, overlaps or ends after the file")
        at = end
        whole = end <= len(body)
        there = body[begin:end] if whole or name == "packed.data" else None
        tensors[name] = (dtype, shape, None if there is None else np.frombuffer(there, DTYPES[dtype] if whole else "u1"))
    check(at == len(body) or beginning, "bytes follow the last tensor")
    return meta, tensors, data[:8 + length], {name: (begin, end) for begin, end, name, _, _ in entries}


def check_version(meta):
    check(meta.get("format") in ("lexi", "lexi-dictionary"), "this is no .lexi file")
    version = whole(meta, "version", 1 << 64)
    check(version <= NEWEST, f"version {version} is above {NEWEST}, the newest known")
    check(version in (1, PACKED), f"there is no version {version}")
    check(meta["format"] == "lexi", "this is a dictionary alone, not a scene")
    layout = meta.get("layout", "packed" if version == PACKED else None)
    check(layout in (("f32", "f16", "paper") if version == 1 else ("packed",)), f"no layout {layout} in this version")
    return version, layout


def check_sums(meta, tensors, head, version, names):
    if version == PACKED:
        dtype, shape, own = tensors.get("packed.head", (None, [], None))
        check(dtype == "U8" and len(shape) == 1 and own is not None and len(own) >= 4, "no packed.head")
        own = own.tobytes()
        check(zlib.crc32(head + own[4:]) == int.from_bytes(own[:4], "little"), "the header or packed.head is damaged")
        bare = {"packed.head", "packed.data"}
    else:
        dtype, shape, value = tensors.get("checksum.header", (None, [], None))
        check(dtype == "U32" and shape == [1], "no checksum of the header")
        check(zlib.crc32(head) == int(value[0]), "the header is damaged")
        bare = {"checksum.header"}
    sums = parse_json(meta.get("checksums", "{}" if version == PACKED else ""))
    check(isinstance(sums, dict) and set(sums) == names - bare,
          "checksums are not of all tensors that have one, and of nothing else")
    for name, text in sums.items():
        check(isinstance(text, str) and SUM.fullmatch(text), f"the checksum of {name} is not of eight digits")
        own = tensors[name][2]
        check(own is None or text == f"{zlib.crc32(own.tobytes()):08x}", f"tensor {name} is damaged")


# Metadata

def whole(meta, key, limit):
    text = meta.get(key, "")
    check(INTEGER.fullmatch(text) is not None and len(text) <= 20 and int(text) < limit,
          f"metadata {key} is not an integer below {limit}")
    return int(text)


def real(meta, key):
    text = meta.get(key, "")
    check(NUMBER.fullmatch(text) is not None, f"metadata {key} is not a number as in JSON")
    check(math.isfinite(float(text)) and float(text) >= 0, f"{key} is negative or not finite")


def finite(v):
    return type(v) in (int, float) and abs(v) <= sys.float_info.max     # an integer may be too large for f64


def check_object(meta, key, numbers, target):
    if key not in meta:
        return
    o = parse_json(meta[key])
    check(isinstance(o, dict) and set(o) >= set(numbers) | {"views", "cameras"} | ({"kind"} if target else set()),
          f"bad members of {key}")
    check(all(finite(o[k]) for k in numbers), f"bad numbers of {key}")
    check(type(o["views"]) is int and 0 <= o["views"] < 1 << 32 and type(o["cameras"]) is bool, f"bad views or cameras of {key}")
    check(not target or isinstance(o["kind"], str), f"bad kind of {key}")


def offset_of(meta):
    """What is added to positions to get to the world of the source; None if there is none."""
    if "offset" not in meta:
        return None
    offset = parse_json(meta["offset"])
    check(isinstance(offset, list) and len(offset) == 3 and all(map(finite, offset)),
          "metadata offset is not a list of three finite numbers")
    return [float(v) for v in offset]


def check_packed_metadata(meta):
    """Check every key of a packed file, and return the degree."""
    degree = whole(meta, "degree", 5)
    whole(meta, "gaussians", (1 << 32) - 1)
    for key, limit in (("seed", 1 << 64), ("over_tolerance", 1 << 64), ("removed", 1 << 64), ("max_nonzeros", 256)):
        if key in meta:
            whole(meta, key, limit)
    for key in ("tolerance", "max_residual", "rms_residual"):
        if key in meta:
            real(meta, key)
    check(meta.get("antialiased", "false") in ("true", "false"), "metadata antialiased is neither true nor false")
    comments = parse_json(meta.get("comments", "[]"))
    check(isinstance(comments, list) and all(isinstance(c, str) for c in comments),
          "metadata comments is not a JSON list of strings")
    offset_of(meta)
    check_object(meta, "target", ("asked", "mean_psnr", "min_psnr"), True)
    check_object(meta, "reached", ("judged_psnr", "mean_psnr", "min_psnr"), False)
    return degree


def check_metadata(meta):
    """Check every key of a file of the other layouts, and return the degree."""
    degree = whole(meta, "degree", 5)
    check(meta.get("pursuit") in ("omp", "ols"), "metadata pursuit is neither omp nor ols")
    if "max_nonzeros" in meta:
        whole(meta, "max_nonzeros", 256)
    for key in ("tolerance", "max_residual", "rms_residual"):
        if key in meta or key != "tolerance":
            real(meta, key)
    whole(meta, "seed", 1 << 64)
    whole(meta, "over_tolerance", 1 << 64)
    check(meta.get("antialiased") in ("true", "false"), "metadata antialiased is neither true nor false")
    comments = parse_json(meta.get("comments", ""))
    check(isinstance(comments, list) and all(isinstance(c, str) for c in comments),
          "metadata comments is not a JSON list of strings")
    offset_of(meta)
    return degree


# Tensors of all layouts

class Tensors:
    """Tensors that are taken by name. What is not taken in the end must be named x-."""

    def __init__(self, tensors):
        self.left = dict(tensors)

    def take(self, name, dtype, shape):
        check(name in self.left, f"no tensor {name}")
        kind, own, entries = self.left.pop(name)
        check(kind == dtype, f"{name} is not of type {dtype}")
        check(len(own) == len(shape) and all(s is None or s == a for s, a in zip(shape, own)), f"bad shape of {name}")
        return entries.reshape(own) if entries is not None and entries.size == math.prod(own) else entries

    def extras(self, n, coded=False):
        result = {}
        for name in [x for x in self.left if x.startswith("extra.")]:
            own = name[6:]
            check(own and not any(c.isspace() or unicodedata.category(c) == "Cc" for c in own) and not RESERVED.fullmatch(own),
                  f"an extra must not be named as {name}")
            if coded:
                result[own] = self.column(name, n)
                continue
            check(self.left[name][0] in EXTRA_TYPES, f"bad type of {name}")
            result[own] = self.take(name, self.left[name][0], (n,))
        return result

    def column(self, name, n):
        """Return a coded column; None without a number of rows."""
        data = self.take(name, "U8", (None,))
        return None if n is None else lexi3.read_column(data.tobytes(), n)

    def finish(self):
        for name in self.left:
            check(name.startswith("x-"), f"unknown tensor {name}")


def check_atoms(atoms):
    check(np.isfinite(atoms).all(), "an atom is not finite")
    norms = np.sqrt((atoms.astype(np.float64) ** 2).sum(1))
    check((np.abs(norms - 1) <= 1e-5).all(), "an atom is not of norm 1")


def sh_row(d, atoms, indices, values):
    """Sum value times atom. Each product and each sum is rounded to f32."""
    row = np.zeros(d, F)
    for a, v in zip(indices, values):
        row = row + F(v) * atoms[a]
    return row


def decode_plain(t, layout, d):
    """Decode layouts f32, f16 and paper."""
    _, shape, _ = t.left.get("position", (None, [], None))
    n = shape[0] if shape else 0
    check(n < (1 << 32) - 1, "too many Gaussians")
    out = {k: t.take(k, "F32", s) for k, s in (("position", (n, 3)), ("dc", (n, 3)), ("opacity", (n,)),
                                               ("scale", (n, 3)), ("rotation", (n, 4)))}
    if "normal" in t.left:
        out["normal"] = t.take("normal", "F32", (n, 3))
    for k, v in out.items():
        check(np.isfinite(v).all(), f"{k} is not finite")
    rest = np.zeros((n, d), F)
    if d:
        atoms = t.take("dictionary", "F32", (None, d))
        m = len(atoms)
        check(1 <= m <= 1024, "m is not from 1 to 1024")
        check_atoms(atoms)
        if layout == "paper":
            ends = t.take("codes.pointers", "I32", (n + 1,)).astype(np.int64)
            counts = np.diff(ends)
            check(ends[0] == 0 and (counts >= 0).all(), "pointers do not begin with 0 or fall")
        else:
            counts = t.take("codes.counts", "U8", (n,)).astype(np.int64)
            ends = np.concatenate([[0], np.cumsum(counts)])
        k = int(ends[-1])
        kind = "I32" if layout == "paper" else "U8" if m <= 256 else "U16"
        indices = t.take("codes.indices", kind, (k,)).astype(np.int64)
        values = t.take("codes.values", "F16" if layout == "f16" else "F32", (k,)).astype(F)
        check((counts <= d).all(), "more nonzeros than coefficients")
        check(((indices >= 0) & (indices < m)).all(), "an index is not below m")
        check(np.isfinite(values).all(), "a value is not finite")
        for i in range(n):
            mine = slice(ends[i], ends[i + 1])
            check((np.diff(indices[mine]) > 0).all(), "indices do not ascend")
            rest[i] = sh_row(d, atoms, indices[mine], values[mine])
        check(("escapes.gaussians" in t.left) == ("escapes.rows" in t.left), "half of the escapes")
        if "escapes.rows" in t.left:
            who = t.take("escapes.gaussians", "U32", (None,)).astype(np.int64)
            rows = t.take("escapes.rows", "F32", (len(who), d))
            check((np.diff(who) > 0).all() and (who < n).all() and not counts[who].any(),
                  "escapes.gaussians does not ascend, is not below N, or has nonzeros")
            check(np.isfinite(rows).all(), "an escape is not finite")
            rest[who] = rows
        check(np.isfinite(rest).all(), "SH-rest is not finite")
        out["dictionary"] = atoms
    out["sh_rest"] = rest
    out["extras"] = t.extras(n)
    return out


# The layout packed

def decode_packed(t, meta, d, header, offsets, beginning, trace):
    n = int(meta["gaussians"])
    check(n <= 3 * (header + max(end for _, end in offsets.values())), "more Gaussians than the file has room for")
    data = t.take("packed.data", "U8", (None,)).tobytes()
    begin, end = offsets["packed.data"]
    head = lexi3.Head(t.take("packed.head", "U8", (None,)).tobytes(), n, end - begin, d)
    rows = None if beginning else n                      # a first part has no columns
    order = t.column("packed.order", rows) if "packed.order" in t.left else None
    if order is not None:
        check(order.dtype == np.dtype("<u4") and (np.sort(order) == np.arange(n)).all(), "the order is no permutation")
    extras = t.extras(rows, True)
    t.finish()
    integers, there, sums = lexi3.decode_ranges(head, data, trace)
    check(beginning or there.all(), "a base is missing")
    out = lexi3.values_of(head, integers, there)
    out["extras"] = {} if beginning else extras
    if order is not None:
        out["order"] = order
    return out | {"there": there, "integers": sums, "ranges": head.ranges}


def decode(data, beginning=False, trace=None):
    """Decode the bytes of a file. The arrays are in the order of the file.

    If `beginning`, the bytes may be the first ones of a packed file; they hold the header and packed.head. The
    arrays are then of the Gaussians that have a base. Of a packed file also returned are `there`, which Gaussians these
    are; `integers`, of each range how many integers it decoded to and whether their CRC-32 is right; and `ideal`, for
    some arrays the values before they are rounded to f32, and how far from these others may be. `trace` may be a
    lexi3.Trace, for packed files.
    """
    with np.errstate(all="ignore"):
        meta, tensors, head, offsets = read_container(data, beginning)
        beginning = len(data) < len(head) + max((end for _, end in offsets.values()), default=0)
        version, layout = check_version(meta)
        packed = version == PACKED
        check(packed or not beginning, "only packed files can be decoded in part")
        check(packed or trace is None, "only packed files can be traced")
        check_sums(meta, tensors, head, version, set(offsets))
        degree = check_packed_metadata(meta) if packed else check_metadata(meta)
        d = 3 * ((degree + 1) ** 2 - 1)
        t = Tensors(tensors)
        if packed:
            return meta, decode_packed(t, meta, d, len(head), offsets, beginning, trace)
        t.left.pop("checksum.header")
        out = decode_plain(t, layout, d)
        t.finish()
        return meta, out


def in_source_order(out):
    """Move Gaussian k, with its extras, to index order[k]."""
    if "order" not in out:
        return out
    back = np.argsort(out["order"])
    moved = {k: out[k][back] for k in ("position", "scale", "rotation", "dc", "opacity", "sh_rest", "exact")}
    moved["extras"] = {k: v[back] for k, v in out["extras"].items()}
    if "ideal" in out:
        moved["ideal"] = {k: (v[back], bound[back]) for k, (v, bound) in out["ideal"].items()}
    return out | moved


def main():
    parser = argparse.ArgumentParser(description=__doc__, epilog=TRACE, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", metavar="FILE.lexi")
    parser.add_argument("out", metavar="OUT.npz", nargs="?", help="the arrays that it decodes to")
    parser.add_argument("bytes", metavar="BYTES", nargs="?", type=int, help="how much of the beginning to decode")
    parser.add_argument("--trace", metavar="K", type=int, help="print what the first K Gaussians are decoded from")
    given = parser.parse_args()
    if given.out is None and given.trace is None:
        parser.error("neither OUT.npz nor --trace is given")
    with open(given.file, "rb") as f:
        data = f.read(-1 if given.bytes is None else given.bytes)
    try:
        meta, out = decode(data, given.bytes is not None, None if given.trace is None else lexi3.Trace(given.trace))
    except LexiError as e:
        sys.exit(f"{given.file}: {e}")
    if given.out is None:
        return
    arrays = {k: v for k, v in out.items() if isinstance(v, np.ndarray)}
    arrays.update({f"extra.{k}": v for k, v in out["extras"].items()})
    np.savez(given.out, **arrays)
    if offset_of(meta):
        print(f"positions are relative to {offset_of(meta)}")
    print(f"{len(out['position'])} Gaussians, layout {meta.get('layout', 'packed')}, SH degree {meta['degree']}")
    if "integers" in out:
        good = [right for _, right in out["integers"].values()]
        print(f"{len(good)} ranges, the integers of {sum(good)} are right")
        sys.exit(0 if all(good) else 1)


if __name__ == "__main__":
    main()
