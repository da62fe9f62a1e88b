#!/usr/bin/env python3
"""Decoder of .lexi files (layouts packed, f32, f16 and paper) with NumPy alone.

It is written from docs/FORMAT.md and docs/FORMAT-2.md; lexi3.py beside it holds what is of version 3 alone.
"""
import argparse
import json
import math
import re
import sys
import unicodedata
import zlib
from bisect import bisect_right

import numpy as np

import lexi3
from lexi3 import LexiError, check

F = np.float32
CHUNK = 32768
MAX_HEADER = 4 << 20
NEWEST = 3
TINY = F(2.0 ** -126)
SQRT2, PI, HALF, ONE, TWO = F(math.sqrt(2)), F(math.pi), F(0.5), F(1), F(2)
FINE = F(0.2102241)
FINE_TOP = FINE * F(4000)
DTYPES = {"BOOL": "u1", "U8": "u1", "I8": "i1", "F8_E5M2": "u1", "F8_E4M3": "u1", "I16": "<i2", "U16": "<u2",
          "F16": "<f2", "BF16": "<u2", "I32": "<i4", "U32": "<u4", "F32": "<f4", "F64": "<f8", "I64": "<i8",
          "U64": "<u8"}
EXTRA_TYPES = ("I8", "U8", "I16", "U16", "I32", "U32", "F32", "F64")
# These are the properties of 3DGS, which an extra must not be called. Normals may be extras.
RESERVED = re.compile(r"x|y|z|opacity|f_dc_[0-2]|f_rest_(0|[1-9][0-9]*)|scale_[0-2]|rot_[0-3]")
INTEGER = re.compile(r"0|[1-9][0-9]*")
NUMBER = re.compile(r"-?(0|[1-9][0-9]*)(\.[0-9]+)?([eE][+-]?[0-9]+)?")
CELL, COLOUR, SHAPE, SCALE, POSITION, OPACITY, DC, COUNT, ATOM, VALUE, DICTIONARY = 0, 1, 2, 3, 7, 10, 11, 14, 15, 16, 17

TRACE = """
A trace is of lane 0 of chunk 0 of a file of version 3, range by range in ascending order of kinds (0 is the base), and
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
    def members(pairs):
        check(len({k for k, _ in pairs}) == len(pairs), "JSON names a member twice")
        return dict(pairs)

    def constant(name):
        raise LexiError(f"{name} is not JSON")
    try:
        return json.loads(text, object_pairs_hook=members, parse_constant=constant)
    except (ValueError, RecursionError) as e:
        raise LexiError(f"bad JSON: {e}") from e


def read_container(data, beginning=False):
    """Return the metadata, the tensors as {name: (dtype, array)}, the bytes of the header, and where tensors begin and end.

    If data is the beginning of a file, that is only tensors that are whole, and what is there of packed.data.
    """
    check(len(data) >= 8, "the file is too short")
    length = int.from_bytes(data[:8], "little")
    check(length <= MAX_HEADER and 8 + length <= len(data), "bad length of the header")
    try:
        text = data[8:8 + length].decode("utf-8")
    except UnicodeDecodeError as e:
        raise LexiError("the header is not UTF-8") from e
    header = parse_json(text)
    check(text[:1] == "{" and isinstance(header, dict), "the header is no object")
    meta = header.pop("__metadata__", None)
    check(isinstance(meta, dict) and all(isinstance(v, str) for v in meta.values()), "no metadata of strings")
    body = memoryview(data)[8 + length:]
    entries = []
    for name, e in header.items():
        check(isinstance(e, dict) and set(e) == {"dtype", "shape", "data_offsets"}, f"bad entry {name}")
        dtype, shape, ends = e["dtype"], e["shape"], e["data_offsets"]
        check(isinstance(dtype, str) and dtype in DTYPES, f"{name} is of an unknown type")
        check(all(isinstance(x, list) and all(type(v) is int and v >= 0 for v in x) for x in (shape, ends))
              and len(ends) == 2, f"bad shape or offsets of {name}")
        check(ends[1] - ends[0] == math.prod(shape) * np.dtype(DTYPES[dtype]).itemsize, f"bad size of {name}")
        entries.append((ends[0], ends[1], name, dtype, shape))
    at, tensors = 0, {}
    for begin, end, name, dtype, shape in sorted(entries):
        check(begin == at and (end <= len(body) or beginning), f"{name} leaves a hole, overlaps or ends after the file")
        at = end
        if end <= len(body):
            tensors[name] = (dtype, np.frombuffer(body[begin:end], DTYPES[dtype]).reshape(shape))
        elif name == "packed.data":
            tensors[name] = (dtype, np.frombuffer(body[begin:], "u1"))
    check(at == len(body) or beginning, "bytes follow the last tensor")
    return meta, tensors, data[:8 + length], {name: (begin, end) for begin, end, name, _, _ in entries}


def check_version(meta):
    check(meta.get("format") in ("lexi", "lexi-dictionary"), "this is no .lexi file")
    version = whole(meta, "version", 1 << 64)
    check(version <= NEWEST, f"version {version} is above {NEWEST}, the newest known")
    check(version >= 1, "there is no version 0")
    check(meta["format"] == "lexi", "this is a dictionary alone, not a scene")
    layout = meta.get("layout", "packed" if version == 3 else None)
    check(layout in (("f32", "f16", "paper") if version == 1 else ("packed",)), f"no layout {layout} in this version")
    return version, layout


def check_sums(meta, tensors, head, version, beginning):
    if version == 3:
        dtype, own = tensors.get("packed.head", (None, None))
        check(dtype == "U8" and own.ndim == 1 and len(own) >= 4, "no packed.head")
        own = own.tobytes()
        check(zlib.crc32(head + own[4:]) == int.from_bytes(own[:4], "little"), "the header or packed.head is damaged")
        bare = {"packed.head", "packed.data"}
        sums = parse_json(meta.get("checksums", "{}"))
        check(isinstance(sums, dict) and (beginning or set(sums) == set(tensors) - bare) and not set(sums) & bare,
              "checksums do not fit the tensors")
        check_tensors({k: v for k, v in sums.items() if k in tensors}, tensors)
        return
    dtype, value = tensors.get("checksum.header", (None, None))
    check(dtype == "U32" and value.shape == (1,), "no checksum of the header")
    check(zlib.crc32(head) == int(value[0]), "the header is damaged")
    sums = parse_json(meta.get("checksums", ""))
    check(isinstance(sums, dict) and set(sums) == set(tensors) - {"checksum.header"}, "checksums do not fit the tensors")
    check_tensors(sums, tensors)


def check_tensors(sums, tensors):
    for name, text in sums.items():
        check(text == f"{zlib.crc32(tensors[name][1].tobytes()):08x}", f"tensor {name} is damaged")


# Metadata

def whole(meta, key, limit):
    text = meta.get(key, "")
    check(INTEGER.fullmatch(text) is not None and int(text) < limit, f"bad metadata {key}")
    return int(text)


def real(meta, key):
    text = meta.get(key, "")
    check(NUMBER.fullmatch(text) is not None, f"bad metadata {key}")
    check(math.isfinite(float(text)) and float(text) >= 0, f"{key} is negative or not finite")


def check_object(meta, key, numbers, target):
    if key not in meta:
        return
    o = parse_json(meta[key])
    check(isinstance(o, dict) and set(o) == set(numbers) | {"views", "cameras"} | ({"target"} if target else set()),
          f"bad members of {key}")
    check(all(type(o[k]) in (int, float) and math.isfinite(o[k]) for k in numbers), f"bad numbers of {key}")
    check(type(o["views"]) is int and o["views"] >= 0 and type(o["cameras"]) is bool, f"bad views or cameras of {key}")
    check(not target or o["target"] in ("psnr", "min-psnr", "size"), f"bad target of {key}")


def offset_of(meta):
    """What is added to positions to get to the world of the source; None if there is none."""
    if "offset" not in meta:
        return None
    offset = parse_json(meta["offset"])
    check(isinstance(offset, list) and len(offset) == 3 and all(type(v) in (int, float) and math.isfinite(v) for v in offset),
          "bad metadata offset")
    return [float(v) for v in offset]


def check_metadata_3(meta):
    """Check every key of version 3, and return the degree."""
    degree = whole(meta, "degree", 5)
    whole(meta, "gaussians", (1 << 32) - 1)
    for key, limit in (("seed", 1 << 64), ("over_tolerance", 1 << 64), ("removed", 1 << 64), ("max_nonzeros", 256)):
        if key in meta:
            whole(meta, key, limit)
    for key in ("tolerance", "max_residual", "rms_residual"):
        if key in meta:
            real(meta, key)
    check(meta.get("antialiased", "false") in ("true", "false"), "bad metadata antialiased")
    comments = parse_json(meta.get("comments", "[]"))
    check(isinstance(comments, list) and all(isinstance(c, str) for c in comments), "bad metadata comments")
    offset_of(meta)
    check_object(meta, "promise", ("asked", "mean_psnr", "min_psnr"), True)
    check_object(meta, "reached", ("judged_psnr", "mean_psnr", "min_psnr"), False)
    return degree


def check_metadata(meta, layout):
    """Check every key, and return the degree."""
    packed = layout == "packed"
    degree = whole(meta, "degree", 5)
    check(meta.get("pursuit") in (("omp",) if packed else ("omp", "ols")), "bad metadata pursuit")
    if "max_nonzeros" in meta:
        check(not packed, "max_nonzeros in layout packed")
        whole(meta, "max_nonzeros", 256)
    elif not packed:
        check("tolerance" in meta, "neither tolerance nor max_nonzeros")
    for key in ("tolerance", "max_residual", "rms_residual"):
        if key in meta or key != "tolerance":
            real(meta, key)
    whole(meta, "seed", 1 << 64)
    whole(meta, "over_tolerance", 1 << 64 if "max_nonzeros" in meta else 1)
    check(meta.get("antialiased") in ("true", "false"), "bad metadata antialiased")
    check("generator" in meta, "no metadata generator")
    comments = parse_json(meta.get("comments", ""))
    check(isinstance(comments, list) and all(isinstance(c, str) for c in comments), "bad metadata comments")
    offset_of(meta)
    if packed:
        whole(meta, "gaussians", (1 << 32) - 1)
        atoms = whole(meta, "atoms", 1025)
        check((atoms == 0) == (degree == 0), "bad metadata atoms")
        whole(meta, "atom_bits", 15)
        if "removed" in meta:
            whole(meta, "removed", 1 << 64)
        check_object(meta, "promise", ("asked", "mean_psnr", "min_psnr"), True)
        check_object(meta, "reached", ("judged_psnr", "mean_psnr", "min_psnr"), False)
    return degree


# Tensors of all layouts

class Tensors:
    """Tensors that are taken by name. What is not taken in the end must be named x-."""

    def __init__(self, tensors):
        self.left = dict(tensors)

    def take(self, name, dtype, shape):
        check(name in self.left, f"no tensor {name}")
        kind, array = self.left.pop(name)
        check(kind == dtype and len(array.shape) == len(shape)
              and all(s is None or s == a for s, a in zip(shape, array.shape)), f"bad type or shape of {name}")
        return array

    def extras(self, n, coded=False):
        result = {}
        for name in [x for x in self.left if x.startswith("extra.")]:
            own = name[6:]
            check(own and not any(c.isspace() or unicodedata.category(c) == "Cc" for c in own) and not RESERVED.fullmatch(own),
                  f"bad name {name}")
            if coded:
                result[own] = lexi3.read_column(self.take(name, "U8", (None,)).tobytes(), n)
                continue
            check(self.left[name][0] in EXTRA_TYPES, f"bad type of {name}")
            result[own] = self.take(name, self.left[name][0], (n,))
        return result

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
    n = len(t.left["position"][1]) if "position" in t.left and t.left["position"][1].ndim else 0
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
        check(1 <= m <= 1024, "bad number of atoms")
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
            check((np.diff(who) > 0).all() and (who < n).all() and not counts[who].any(), "bad escapes")
            check(np.isfinite(rows).all(), "an escape is not finite")
            rest[who] = rows
        check(np.isfinite(rest).all(), "SH-rest is not finite")
        out["dictionary"] = atoms
    out["sh_rest"] = rest
    out["extras"] = t.extras(n)
    return out


# Bits and symbols

class Bits:
    """Bits of each byte, the least significant first."""

    def __init__(self, data):
        self.data, self.at, self.size = data, 0, 8 * len(data)

    def bits(self, n):
        check(self.at + n <= self.size, "bits are read beyond the end")
        first = self.at >> 3
        word = int.from_bytes(self.data[first:(self.at + n + 7) >> 3], "little")
        value = (word >> (self.at & 7)) & ((1 << n) - 1)
        self.at += n
        return value

    def finish(self):
        left = self.size - self.at
        check(left < 8 and self.bits(left) == 0, "bits are left")


class Table:
    """Symbols with a probability that is a multiple of 2^-12."""

    def __init__(self, counts):
        total = sum(counts)
        check(total > 0, "a table has no symbol")
        self.symbols = [s for s, c in enumerate(counts) if c]
        p = [max(counts[s] * 4096 // total, 1) for s in self.symbols]
        left = 4096 - sum(p)
        while left:
            k = p.index(max(p))
            step = left if left > 0 else max(left, -(p[k] // 2))
            p[k] += step
            left -= step
        self.p, self.start = p, [0] * len(p)
        for k in range(1, len(p)):
            self.start[k] = self.start[k - 1] + p[k - 1]


def read_tables(data):
    """Return for each stream the table of each context, or None where there is none."""
    b, streams = Bits(data), []
    for _ in range(18):
        c, table_of, tables = 0, [], []
        for _ in range(24):
            if b.bits(1):
                c = b.bits(5)
            table_of.append(c)
        for _ in range(b.bits(5)):
            size, counts = b.bits(11), []
            check(size <= 1024, "a table has too many symbols")
            for _ in range(size):
                length = b.bits(4)
                k = min(max(length - 1, 0), 3)
                low = b.bits(k)
                counts.append(((1 << k) + low) << (length - 1 - k) if length else 0)
            tables.append(Table(counts))
        streams.append([tables[c] if c < len(tables) else None for c in table_of])
    b.finish()
    return streams


class Pair:
    """A pair of parts: modelled symbols and raw bits."""

    def __init__(self, streams, modelled, raw):
        check(len(modelled) % 4 == 0, "modelled symbols are not whole words")
        self.words = np.frombuffer(modelled, "<u4").tolist()
        check(not self.words or self.words[-1] != 0, "the last word is 0")
        self.state = self.words.pop() if self.words else 0
        if self.words:
            self.state = self.state << 32 | self.words.pop()
        self.streams, self.raw = streams, Bits(raw)
        self.bits = self.raw.bits

    def symbol(self, stream, context):
        table = self.streams[stream][context]
        check(table is not None, "a context has no table")
        if len(table.symbols) == 1:
            return table.symbols[0]
        q = self.state & 4095
        k = bisect_right(table.start, q) - 1
        self.state = (self.state >> 12) * table.p[k] + (q - table.start[k])
        if self.state < 1 << 32 and self.words:
            self.state = self.state << 32 | self.words.pop()
        return table.symbols[k]

    def integer(self, stream, context):
        t = self.symbol(stream, context)
        if t < 16:
            return t
        check(t <= 135, "a token is above 135")
        n = (t - 16) // 2 + 3
        return ((2 + (t - 16) % 2) << n) + self.bits(n)

    def signed(self, stream, context):
        u = self.integer(stream, context)
        return -(u // 2) - 1 if u & 1 else u // 2

    def finish(self):
        check(not self.words and self.state == 0, "modelled symbols are left")
        self.raw.finish()


# Arithmetic in f32

def f32_of_int(i):
    """Convert an integer to f32. Large ones are cut to 53 bits with a sticky bit, so that they are rounded once."""
    if abs(i) < 1 << 53:
        return F(i)
    cut = abs(i).bit_length() - 53
    odd = (abs(i) >> cut) | (1 if abs(i) & ((1 << cut) - 1) else 0)
    return F(math.copysign(math.ldexp(odd, cut), i))


def rounded(f, x):
    """Evaluate f in f64 and round the result to f32."""
    try:
        return F(f(float(x)))
    except OverflowError:
        return F(math.inf)


def clamp(x, a, b):
    return min(max(x, a), b)


def level(x):
    return int(clamp(np.floor(x + HALF), F(0), F(15)))


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def normalised(a):
    r = ONE / np.fmax(np.sqrt(dot(a, a)), TINY)
    return [x * r for x in a]


def fineness(x):
    mantissa, exponent = math.frexp(float(clamp(x, FINE, FINE_TOP) / FINE))
    return 2 * (exponent - 1) + (1 if F(mantissa * 2) >= SQRT2 else 0)


def width(x):
    return next((n for n in range(15) if x <= F(2 ** n) * SQRT2), 15)


def row(r, s):
    return r[0] + r[1] * s[0] + r[2] * s[1] + r[3] * s[2]


def decode_axes(bits, scale, turn_step):
    needle = scale[0] - scale[1] >= scale[1] - scale[2]
    main = 0 if needle else 2
    i, j = (1, 2) if needle else (0, 1)
    n = width(F(2.5) / np.sqrt(turn_step[i] * turn_step[j]))
    size = F(2 ** n)
    s = (F(bits(n)) + HALF) / size * TWO - ONE
    t = (F(bits(n)) + HALF) / size * TWO - ONE
    x, y = HALF * (s + t), HALF * (s - t)
    u = normalised([x, y, np.fmax(ONE - abs(x) - abs(y), F(0))])
    k = min(range(3), key=lambda k: abs(u[k]))
    first = normalised(cross([F(k == a) for a in range(3)], u))
    second = cross(u, first)
    n = width(PI / turn_step[main])
    angle = (F(bits(n)) + HALF) / F(2 ** n) * PI
    c, s = rounded(math.cos, angle), rounded(math.sin, angle)
    v = [c * first[k] + s * second[k] for k in range(3)]
    return [u, v, cross(u, v)] if needle else [v, cross(u, v), u]


def quaternion(a, b, c):
    t = [ONE + a[0] + b[1] + c[2], ONE + a[0] - b[1] - c[2], ONE - a[0] + b[1] - c[2], ONE - a[0] - b[1] + c[2]]
    which = max(range(4), key=lambda k: t[k])
    l = np.sqrt(np.fmax(t[which], TINY))
    h, r = HALF * l, HALF / l
    X, Y, Z = (b[2] - c[1]) * r, (c[0] - a[2]) * r, (a[1] - b[0]) * r
    P, Q, R = (a[1] + b[0]) * r, (a[2] + c[0]) * r, (b[2] + c[1]) * r
    q = ([h, X, Y, Z], [X, h, P, Q], [Y, P, h, R], [Z, Q, R, h])[which]
    return [-x for x in q] if q[0] < 0 else q


# The layout packed

def read_dictionary(pair, m, d, atom_bits):
    atoms = np.zeros((m, d), F)
    for row_of in atoms:
        c, norm = [], 0.0
        for j in range(d):
            c.append(float(pair.signed(DICTIONARY, math.isqrt(j % (d // 3) + 1) - 1)) / 2 ** atom_bits)
            norm += c[j] * c[j]
        norm = math.sqrt(norm)
        if norm == 0:
            c[0] = norm = 1.0
        row_of[:] = [F(x / norm) for x in c]
    pair.finish()
    check_atoms(atoms)
    return atoms


class Parameters:
    def __init__(self, p):
        check(np.isfinite(p).all(), "a parameter is not finite")
        check((p[3:12] > 0).all() and p[12] >= 0, "cell, a step or a factor is not above 0")
        self.origin, self.cell, self.base = p[0:3], p[3], p[4:6]
        self.f_dc, self.f_value, self.f_opacity, self.f_scale, self.promised = p[6], p[7], p[8], p[9:12], p[12]
        self.turn, self.move = p[13:25].reshape(3, 4), p[25:37].reshape(3, 4)
        self.dc_mean, self.dc_axes = p[37:40], p[40:49].reshape(3, 3)
        self.means, self.predictor = p[49:56], p[56:105].reshape(7, 7)

    def unit(self, k, c):
        return self.base[k] * F(2 ** c)


def xyz_of(z):
    xyz = [0, 0, 0]
    for k in range(63):
        xyz[k % 3] |= (z >> k & 1) << (k // 3)
    return xyz


def decode_chunk(pair, p, out, first, n, d, atoms):
    z, g = 0, 0
    slots, memory = np.zeros((16, 3), F), np.zeros((16, 10), F)
    h2 = (HALF * p.cell) * (HALF * p.cell)
    pad = np.zeros(3, F)

    def coded(stream, context, prediction, step):
        return prediction + f32_of_int(pair.signed(stream, context)) * step

    for i in range(n):
        gap = pair.integer(CELL, min(g, 23))
        z, g = z + gap, gap.bit_length()
        check(z < 1 << 63, "a cell is out of range")
        centre = [float(p.origin[k]) + (c + 0.5) * float(p.cell) for k, c in enumerate(xyz_of(z))]
        near = np.array(centre).astype(F)

        used = min(i, 16)
        known = used > 0
        if known:
            D = slots[:used] - near
            w = ONE / (D[:, 0] * D[:, 0] + D[:, 1] * D[:, 1] + D[:, 2] * D[:, 2] + h2)
            total, sums = F(0), np.zeros(10, F)
            for k in range(used):
                total = total + w[k]
                sums = sums + w[k] * memory[k]
            around = sums / total
            known = bool(np.isfinite(around).all())
        if not known:
            around = np.concatenate([p.means, pad])

        colour = pair.symbol(COLOUR, 1 + level(around[7]) if known else 0)
        check(colour <= 15, "a class is out of range")
        expected = clamp(F(colour) + around[8], F(0), F(15))
        context = 1 + level(TWO * (expected - np.floor(expected - F(0.25)))) if known else 0
        shape = level(expected) + pair.signed(SHAPE, context)
        check(0 <= shape <= 15, "a class is out of range")

        scale = [F(0)] * 3

        def prediction(t):
            P, x = p.predictor[t], F(0)
            for a, b in zip(P, [ONE, around[t], F(colour), F(shape)] + scale):
                x = x + a * b
            return x
        for k in range(3):
            step = np.fmin(p.unit(1, shape) * p.f_scale[k], F(1.5))
            scale[k] = coded(SCALE + k, shape, prediction(k), step)
            check(np.isfinite(scale[k]), "a scale is not finite")
        step = np.fmin(p.unit(1, shape) * p.f_opacity, F(1.5))
        o = np.fmin(coded(OPACITY, shape, prediction(3), step), F(-0.0001))
        check(np.isfinite(o), "an opacity is not finite")
        opacity = F(float(o) - math.log(-math.expm1(float(o))))

        turn_step = [np.fmin(p.unit(1, shape) * rounded(math.exp2, row(p.turn[k], scale)), F(1.2)) for k in range(3)]
        axes = decode_axes(pair.bits, scale, turn_step)

        widest = TWO * rounded(math.exp, clamp(scale[0], F(-60), F(60)))
        x = list(centre)
        for k in range(3):
            step = np.fmax(np.fmin(p.unit(1, shape) * rounded(math.exp2, row(p.move[k], scale)), widest), TINY)
            a = coded(POSITION + k, fineness(p.cell / step), F(0), step)
            for j in range(3):
                x[j] += float(a) * float(axes[k][j])
        position = np.array(x).astype(F)

        step = p.unit(0, colour) * p.f_dc
        b = [coded(DC + k, colour, prediction(4 + k), step) for k in range(3)]
        dc = [p.dc_mean[j] + b[0] * p.dc_axes[0][j] + b[1] * p.dc_axes[1][j] + b[2] * p.dc_axes[2][j] for j in range(3)]

        count = 0
        if d:
            count = pair.integer(COUNT, 2 * min(colour, 11) + (1 if around[9] > 1 else 0))
            check(count <= d + 1, "a Gaussian has too many nonzeros")
            if count == d + 1:
                rest = np.array([pair.bits(32) for _ in range(d)], "<u4").view("<f4")
                out["exact"][first + i], count = True, 0
            else:
                step = p.promised if p.promised > 0 else p.unit(0, colour) * p.f_value
                codes, last = {}, 0
                for k in range(count):
                    atom = pair.symbol(ATOM, min(k, 1))
                    check(atom < len(atoms) and atom not in codes, "an atom is out of range or there twice")
                    last = pair.integer(VALUE, 8 + min(last, 15) if k else min(count - 1, 7))
                    check(last + 1 < 1 << 31, "a value is out of range")
                    value = F(last + 1) * step
                    codes[atom] = F(np.float16(-value if pair.bits(1) else value))
                    check(np.isfinite(codes[atom]), "a value is not finite")
                rest = sh_row(d, atoms, sorted(codes), [codes[a] for a in sorted(codes)])
            out["sh_rest"][first + i] = rest

        slots[i % 16], memory[i % 16] = position, scale + [o] + b + [F(colour), F(shape - colour), F(count)]
        for key, value in (("position", position), ("scale", scale), ("opacity", opacity), ("dc", dc),
                           ("rotation", quaternion(*axes))):
            out[key][first + i] = value
        check(all(np.isfinite(out[k][first + i]).all() for k in ("position", "dc", "opacity", "rotation", "sh_rest")),
              "something decoded is not finite")
    pair.finish()


def decode_packed(t, meta, d, file_size):
    n, m = int(meta["gaussians"]), int(meta["atoms"])
    check(n <= 3 * file_size, "more Gaussians than the file has room for")
    chunks = -(-n // CHUNK)
    parameters = t.take("packed.parameters", "F32", (105,))
    lengths = t.take("packed.lengths", "U32", (2 * (chunks + 1),)).tolist()
    tables = t.take("packed.tables", "U8", (None,))
    data = t.take("packed.data", "U8", (sum(lengths),)).tobytes()
    order = None
    if "packed.order" in t.left:
        order = t.take("packed.order", "U32", (n,))
        check((np.sort(order) == np.arange(n)).all(), "the order is no permutation")
    extras = t.extras(n)
    t.finish()
    p, streams = Parameters(parameters), read_tables(tables.tobytes())
    ends = np.cumsum([0] + lengths).tolist()
    parts = [data[a:b] for a, b in zip(ends, ends[1:])]
    check(d or not (parts[0] or parts[1]), "a dictionary at degree 0")
    atoms = read_dictionary(Pair(streams, parts[0], parts[1]), m, d, int(meta["atom_bits"]))
    out = {k: np.zeros((n, w), F) for k, w in (("position", 3), ("scale", 3), ("rotation", 4), ("dc", 3), ("sh_rest", d))}
    out["opacity"], out["exact"] = np.zeros(n, F), np.zeros(n, bool)
    for c in range(chunks):
        pair = Pair(streams, parts[2 * c + 2], parts[2 * c + 3])
        decode_chunk(pair, p, out, c * CHUNK, min(CHUNK, n - c * CHUNK), d, atoms)
    out["extras"], out["dictionary"] = extras, atoms
    if order is not None:
        out["order"] = order
    return out


def decode_version_3(t, meta, d, header, places, beginning, trace):
    n = int(meta["gaussians"])
    check(n <= 3 * (header + max(end for _, end in places.values())), "more Gaussians than the file has room for")
    check("packed.data" in places, "no packed.data")
    begin, end = places["packed.data"]
    size = len(t.left["packed.data"][1]) if "packed.data" in t.left else 0
    data = t.take("packed.data", "U8", (size,)).tobytes() if "packed.data" in t.left or not beginning else b""
    head = lexi3.Head(t.take("packed.head", "U8", (None,)).tobytes(), n, end - begin, d)
    order = None
    if "packed.order" in t.left:
        order = lexi3.read_column(t.take("packed.order", "U8", (None,)).tobytes(), n)
        check(order.dtype == np.dtype("<u4") and (np.sort(order) == np.arange(n)).all(), "the order is no permutation")
    extras = t.extras(n, True)
    t.finish()
    integers, there, sums = lexi3.decode_ranges(head, data, trace)
    check(beginning or there.all(), "a base is missing")
    out = lexi3.values_of(head, integers, there)
    out["extras"] = extras if there.all() else {}
    if order is not None and there.all():
        out["order"] = order
    return out | {"there": there, "integers": sums, "ranges": head.ranges}


def decode(data, beginning=False, trace=None):
    """Decode the bytes of a file. The arrays are in the order of the file.

    If `beginning`, the bytes may be the first ones of a file of version 3; they hold the header and packed.head. The
    arrays are then of the Gaussians that have a base. Of version 3 also returned are `there`, which Gaussians these
    are; `integers`, of each range how many integers it decoded to and whether their CRC-32 is right; and `ideal`, for
    some arrays the values before they are rounded to f32, and how far from these others may be. `trace` may be a
    lexi3.Trace, for files of version 3.
    """
    with np.errstate(all="ignore"):
        meta, tensors, head, places = read_container(data, beginning)
        version, layout = check_version(meta)
        check(version == 3 or not beginning, "only version 3 can be decoded in part")
        check(version == 3 or trace is None, "only version 3 can be traced")
        check_sums(meta, tensors, head, version, beginning)
        degree = check_metadata_3(meta) if version == 3 else check_metadata(meta, layout)
        d = 3 * ((degree + 1) ** 2 - 1)
        t = Tensors(tensors)
        if version == 3:
            return meta, decode_version_3(t, meta, d, len(head), places, beginning, trace)
        t.left.pop("checksum.header")
        out = decode_packed(t, meta, d, len(data)) if layout == "packed" else decode_plain(t, layout, d)
        t.finish()
        return meta, out


def in_source_order(out):
    """Move Gaussian k, with its extras, to place order[k]."""
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
