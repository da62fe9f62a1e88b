"""Layout packed: head, tables, ranges and values. Names are those of docs/FORMAT.md.

All lanes of all chunks are decoded side by side: every variable of a Gaussian is a vector with one element a lane, and
the i-th Gaussians of all lanes are decoded together. Lanes are sorted by falling length, so those that still have a
Gaussian i are always the first ones.
"""
import math
import struct
import zlib

import numpy as np

F = np.float32
I = np.int64
CELL, COLOUR, SHAPE, SCALE, OPACITY, POSITION, DC, FINE_POSITION, FINE_DC = 0, 1, 2, 3, 6, 8, 11, 14, 15
COUNT, ATOM, VALUE, PAGE, INTERIM_SCALE, INTERIM_OPACITY, INTERIM_DC = 16, 19, 22, 25, 26, 27, 28
NAMES = ("Cell", "ColourClass", "ShapeClass", "Scale0", "Scale1", "Scale2", "Opacity", "Rotation", "Position0", "Position1",
         "Position2", "Dc0", "Dc1", "Dc2", "FinePosition", "FineDc", "Count0", "Count1", "Count2", "Atom0", "Atom1",
         "Atom2", "Value0", "Value1", "Value2", "AtomPage", "InterimScale", "InterimOpacity", "InterimDc")
TARGETS = (SCALE, SCALE + 1, SCALE + 2, OPACITY, DC, DC + 1, DC + 2)
# Order of the sets of contexts: streams 0 to 15 three times, then the others.
SETS = [*range(16)] * 3 + [*range(16, 29)]
DROP = np.array([0, 2, 3], I)
POWERS = np.array([1 << k for k in range(63)], I)
S, T, U, V = 0.5773502691896257, 0.7071067811865476, 0.4082482904638631, 0.8164965809277261
COLUMN_TYPES = ("i1", "u1", "<i2", "<u2", "<i4", "<u4", "<f4", "<f8")


class LexiError(ValueError):
    """The file is damaged or of an unsupported kind."""


def check(good, text):
    if not good:
        raise LexiError(text)


class Bytes:
    """Reads numbers one after another."""

    def __init__(self, data):
        self.data, self.at = bytes(data), 0

    def take(self, n):
        check(self.at + n <= len(self.data), "packed.head or a column ends within a field")
        self.at += n
        return self.data[self.at - n:self.at]

    def unpack(self, kinds):
        return struct.unpack("<" + kinds, self.take(struct.calcsize("<" + kinds)))

    def u8(self):
        return self.take(1)[0]

    def varint(self, top=32):
        value = shift = 0
        while True:
            byte = self.u8()
            value |= (byte & 127) << shift
            check(value < 1 << top, "a varint is too large")
            if byte < 128:
                check(byte or not shift, "a varint is longer than it need be")
                return value
            shift += 7

    def f32(self, n):
        return self.floats([self.take(4) for _ in range(n)])

    def f24(self, n):
        return self.floats([bytes(1) + self.take(3) for _ in range(n)])

    def bf16(self, n):
        return self.floats([bytes(2) + self.take(2) for _ in range(n)])

    def floats(self, pieces):
        values = [struct.unpack("<f", x)[0] for x in pieces]
        check(all(map(math.isfinite, values)), "an f32, f24 or bf16 of packed.head is not finite")
        return values

    def end(self):
        return self.at == len(self.data)


# Adaptive bits: integers, tables and dictionary

class BitModel:
    def __init__(self):
        self.zero, self.seen = 2048, 0


def models(*shape):
    return [models(*shape[1:]) for _ in range(shape[0])] if shape else BitModel()


def either_models():
    return models(), models(), models(16)


class AdaptiveBits:
    def __init__(self, data, what):
        self.what = what
        check(len(data) % 2 == 0, f"the {what} are not of whole words")
        self.words = iter(np.frombuffer(data, "<u2").tolist())
        self.state = self.word() << 16 | self.word()
        check(self.state >= 1 << 16, f"the first state of the {what} is below 2^16")

    def word(self):
        word = next(self.words, None)
        check(word is not None, f"the {self.what} go beyond their words")
        return word

    def split(self, p):
        low = self.state & 4095
        b = int(low >= p)
        self.state = (self.state >> 12) * (4096 - p if b else p) + low - (p if b else 0)
        if self.state < 1 << 16:
            self.state = self.state << 16 | self.word()
        return b

    def finish(self):
        check(next(self.words, None) is None, f"words of the {self.what} are left")
        check(self.state == 1 << 16, f"the last state of the {self.what} is not 2^16")

    def bit(self, o):
        b = self.split(o.zero)
        rate = (1, 2, 3, 4, 4, 5)[min(o.seen, 5)]
        o.seen += 1
        zero = o.zero - (o.zero >> rate) if b else o.zero + (4096 - o.zero >> rate)
        o.zero = min(max(zero, 48), 4048)
        return b

    def even(self, n):
        value = 0
        for _ in range(n):
            value = 2 * value + self.split(2048)
        return value

    def positive(self, o):
        n = 1
        while n < len(o) and self.bit(o[n]):
            n += 1
        return (1 << n - 1) + self.even(n - 1)

    def either(self, o):
        nonzero, negative, size = o
        if not self.bit(nonzero):
            return 0
        s = self.bit(negative)
        u = self.positive(size)
        return -u if s else u


def probabilities(weights, w):
    """Of symbols with these weights; the weight of one that does not occur is 0."""
    total, n = sum(weights), sum(x > 0 for x in weights)
    p = [1 + x * ((1 << w) - n) // total if x else 0 for x in weights]
    p[p.index(max(p))] += (1 << w) - sum(p)
    return p


class Tables:
    """For each number of 0 to 2^w - 1, and each table, the symbol and what becomes of the state."""

    def __init__(self, data):
        bits = AdaptiveBits(data, "tables")
        self.used, self.many, self.same, self.new = models(2), models(), models(2), models()
        self.counts, self.present, self.delta = models(10), models(2), either_models()
        self.start = np.full(len(SETS) * 24, -1, I)     # where the table of a context begins, -1 if there is none
        p, rest, symbol = [], [], []
        at = before = 0
        for number, stream in enumerate(SETS):
            before = bits.bit(self.used[before])
            if not before:
                continue
            count, table_of = self.contexts(bits)
            w = 12 if ATOM <= stream < ATOM + 3 else 10
            for _ in range(count):
                probability = self.table(bits, w)
                p.append(np.repeat(probability, probability))
                symbol.append(np.repeat(np.arange(len(probability)), probability))
                rest.append(np.arange(1 << w) - np.repeat(np.cumsum(probability) - probability, probability))
            self.start[number * 24:number * 24 + 24] = at + (np.array(table_of) << w)
            at += count << w
        bits.finish()
        self.p, self.rest, self.symbol = (np.concatenate(x or [[0]]).astype(I) for x in (p, rest, symbol))

    def contexts(self, bits):
        tables, last, changed, table_of = 1, 0, 0, [0]
        several = bits.bit(self.many)
        for context in range(1, 24):
            if several:
                changed = bits.bit(self.same[1 if context > 1 and changed else 0])
                if changed:
                    new = bits.bit(self.new)
                    last = tables if new else bits.even((tables - 1).bit_length())
                    check(new or last < tables, "a table that is named is not below T")
                tables = max(tables, last + 1)
            table_of.append(last)
        return tables, table_of

    def table(self, bits, w):
        size = bits.positive(self.counts)
        check(size <= 256, "S of a table is above 256")
        occurs, weights = 1, []
        for i in range(size):
            occurs = 1 if i == size - 1 else bits.bit(self.present[occurs])     # of the symbol before
            if i == 0:
                level = bits.even(5)
            elif occurs:
                level += bits.either(self.delta)
            check(0 <= level <= 2 * w, "a level of a table is not from 0 to 2w")
            up = 2 * w - level
            weights.append((32, 45)[up % 2] << (up >> 1) if occurs else 0)
        return np.array(probabilities(weights, w))


def read_dictionary(data, m, d, fixed):
    learned, n, atoms = m - d if fixed else m, d // 3, np.zeros((m, d), F)
    check(learned or not data, "the dictionary is not empty, though no atom is learned")
    bits = AdaptiveBits(data, "numbers of the dictionary") if learned else None
    o = [[[either_models() for _ in range(5)] for _ in range(3)] for _ in range(4)]
    for atom in atoms[:learned]:
        x = [[0, 0, 0] for _ in range(n)]
        for k in range(n):
            for a in range(3):
                def size(j, b):
                    return abs(x[j][b]) if j >= 0 else 0
                near = size(k - 1, 0) + size(k - 2, 0) if a == 0 else size(k - 1, a) + (size(k, 0) >> 1)
                x[k][a] = bits.either(o[min(math.isqrt(k + 1) - 1, 3)][a][min(near.bit_length(), 4)])
                check(abs(x[k][a]) < 1 << 15, "a number of the dictionary is above 2^15 - 1 in size")
        c = ([v[0] * S + v[1] * T + v[2] * U for v in x] + [v[0] * S + v[1] * 0.0 - v[2] * V for v in x]
             + [v[0] * S - v[1] * T + v[2] * U for v in x])
        norm = 0.0
        for v in c:
            norm += v * v
        if norm == 0:
            c[0] = norm = 1.0
        atom[:] = np.array(c) / math.sqrt(norm)
    if learned:
        bits.finish()
    if fixed:
        for a, parts in enumerate(((S, S, S), (T, 0, -T), (U, -V, U))):
            for k in range(n):
                atoms[m - d + a * n + k, [k, n + k, 2 * n + k]] = parts
    return atoms


# Head and index

class Head:
    def __init__(self, data, total, size, d):
        b = Bytes(data)
        b.take(4)                                        # the CRC-32, which decode_lexi.py has checked
        self.d, self.m = d, b.varint()
        flags = b.u8()
        views, self.parts, self.promised = flags & 15, flags >> 4 & 3, flags >> 6 & 1
        check((1 <= self.m <= 1024) if d else self.m == 0, "m is not from 1 to 1024, or not 0 at degree 0")
        check((self.parts > 0) == (d > 0), "P is not from 1 to 3, or not 0 at degree 0")
        check(flags < 128 or self.m >= d > 0, "atoms are `fixed`, but m < d or d = 0")
        self.dc_exponent = b.u8()
        self.interim, self.dc_exponent = self.dc_exponent >> 7, self.dc_exponent & 127
        check(self.dc_exponent <= 100, "dc_exponent is above 100")
        self.least = [*b.take(self.parts - 1), 1] if self.parts else []
        check(all(x > y for x, y in zip(self.least, self.least[1:])), "least does not fall strictly, or is not above 1")
        self.interim_step = [b.varint() for _ in range(3)] if self.interim else [1] * 3
        check(all(1 <= x <= 1 << 26 for x in self.interim_step), "interim_step is not from 1 to 2^26")
        self.origin, (self.side, self.value_step) = np.array(b.f32(3)), b.f32(2)
        check(self.side > 0, "side is not above 0")
        check(self.value_step > 0, "value_step is not above 0")
        self.dc_mean, turn = np.array(b.f32(3)), b.unpack("4h")
        check(any(turn), "dc_turn is 0")
        self.dc_axes = axes_of(*turn)
        self.softening = b.f32(1)[0] if views else 1.0
        check(2.0 ** -60 <= self.softening <= 2.0 ** 60, "softening is not from 2^-60 to 2^60")
        self.points = np.array(b.f24(3 * views)).reshape(views, 3)
        steps = [b.unpack("Hb") for _ in range(5)]
        check(all(-6 <= h <= 31 for _, h in steps), "the shift of a step is not from -6 to 31")
        self.steps = np.array([[min(max(M << min(c - h, 6) if c >= h else M >> h - c, 1), 3 << 19) for c in range(16)]
                               for M, h in steps], I)
        self.read_integers(b.take(b.varint()))
        self.tables = Tables(b.take(b.varint()))
        self.atoms = read_dictionary(b.take(b.varint()), self.m, d, flags >> 7)
        self.read_index(b, total, size)
        check(b.end(), "bytes of the head are left")

    def read_integers(self, data):
        bits = AdaptiveBits(data, "integers")

        def group(count, zeros):
            o = either_models()
            values = [bits.either(o) << zeros for _ in range(count)]
            check(all(-1 << 15 <= x < 1 << 15 for x in values), "one of the integers is not from -32768 to 32767")
            return np.array(values, I)
        self.cell_log = int(group(1, 2)[0])
        self.turn, self.move, self.predictor = np.zeros((3, 4), I), np.zeros((3, 4), I), np.zeros((7, 7), I)
        for rows in (self.turn, self.move):
            rows[:, 0] = group(3, 2)
            rows[:, 1:] = group(9, 4).reshape(3, 3)
        self.means = group(7, 2)
        self.predictor[:, 0] = group(7, 2)
        for k in range(1, 7):
            first = max(k - 3, 0)
            self.predictor[first:, k] = group(7 - first, 4)
        bits.finish()

    def read_index(self, b, total, size):
        layers = b.u8()
        in_order, layers = layers >> 7, layers & 127
        check(layers <= 8, "there are more than 8 layers")
        levels = list(b.take(layers))
        check(all(r <= 2 for r in levels), "R of a layer is above 2")
        self.layer, self.count, self.cell, self.bounds = [], [], [], []
        chunks = b.varint()
        for c in range(chunks):
            self.layer.append(b.u8())
            self.count.append(b.varint())
            self.cell.append(b.varint(64))
            self.bounds.append(b.bf16(6) if chunks > 1 else None)
            check(self.layer[c] < layers, "the layer of a chunk is not there")
            check(1 <= self.count[c] <= 65536, "a chunk has not from 1 to 65536 Gaussians")
            check(c == 0 or (self.layer[c - 1], self.cell[c - 1]) <= (self.layer[c], self.cell[c]),
                  "`cell` of a chunk falls, or chunks do not come layer by layer")
        check(sum(self.count) == total, "chunks do not have N Gaussians")
        self.first = np.concatenate([[0], np.cumsum(self.count)]).astype(I)
        self.refinements = [levels[layer] for layer in self.layer]
        kinds = [1 + r + self.parts + int(self.interim and layer < layers - 1)
                 for r, layer in zip(self.refinements, self.layer)]
        in_turn = [(c, k) for c in range(chunks) for k in range(kinds[c])]
        self.ranges, start = {}, 0                       # of (chunk, kind): start, length and both CRC-32
        for key in in_turn:
            if not in_order:
                key = (b.varint(), b.u8())
                check(key[0] < chunks and key[1] < kinds[key[0]], "a range has a chunk or a kind that is not there")
                check(key not in self.ranges, "a range is listed twice")
                check(key[1] == 0 or (key[0], 0) in self.ranges, "a range is before its base")
            length, *sums = b.varint(), *b.unpack("2I")
            check(key[1] or 8 * length >= 3 * self.count[key[0]], "a base has less than 3 bits a Gaussian")
            self.ranges[key] = (start, length, *sums)
            start += length
        check(size == start, "ranges do not have the length of packed.data")


def axes_of(w, x, y, z):
    n = w * w + x * x + y * y + z * z
    rows = ((w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)),
            (2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)),
            (2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z))
    return np.array([[F(v / n) for v in row] for row in rows], np.float64)


# Lanes

class Trace:
    """Writes what lane 0 of chunk 0 takes for its first Gaussians: lines of symbols and of pieces of raw bits."""

    def __init__(self, gaussians, write=print):
        self.gaussians, self.write, self.kind = gaussians, write, 0


class Lanes:
    """The lanes of some ranges, the longest first. `who` are those that a call is for: a slice or their numbers."""

    def __init__(self, tables, ranges, trace=None):
        """Each of the ranges is its bytes, the first of its Gaussians, their number, and the set of its stream 0."""
        self.tables, self.trace = tables, trace
        lanes, words, begin = [], [], 0
        for data, first, n, base in ranges:
            q = min(max(n // 1024, 1), 16)
            width = 2 if len(data) < 1 << 17 else 4
            head = width * (q - 1)
            check(len(data) % 2 == 0 and len(data) >= head, "a range is not of whole words")
            sizes = np.frombuffer(data[:head], f"<u{width}").tolist()
            sizes.append((len(data) - head) // 2 - sum(sizes))
            check(min(sizes) >= 2, "a lane has less than two words")
            check(sum(sizes) <= 1 << 30, "a range has more than 2^30 words")
            words.append(data[head:])
            for k, size in enumerate(sizes):
                length = n // q + (k < n % q)
                lanes.append((-length, first, base, begin, begin + size))
                first += length
                begin += size
        lanes = np.array(sorted(lanes), I).reshape(-1, 5)
        self.words = np.frombuffer(b"".join(words), "<u2").astype(I)
        self.length, self.first, self.set = -lanes[:, 0], lanes[:, 1], lanes[:, 2] * 24
        self.next, self.stop = lanes[:, 3] + 2, lanes[:, 4]
        self.state = (self.words[self.next - 2] << 16) + self.words[self.next - 1]
        self.lane, self.steps = np.arange(len(lanes)), int(self.length.max(initial=0))
        check((self.state >= 1 << 16).all(), "the first state of a lane is below 2^16")
        # The lane that is traced, none if it has no such range, and of which Gaussian what it takes is.
        self.traced = np.flatnonzero(self.first == 0) if trace else self.lane[:0]
        self.of(0)

    def of(self, gaussian, name=None):
        """Say that what the traced lane takes from here on is of this Gaussian of the lane, and what a trace calls it."""
        self.gaussian, self.name = gaussian, gaussian if name is None else name

    def note(self, who, *what):
        """Trace a step. Each of what is a text, a number of all lanes, or the numbers of the lanes that the step is of."""
        lanes = self.lane[who]
        at = np.flatnonzero(lanes == self.traced)
        if len(at) and self.gaussian < self.trace.gaussians:
            what = [x if isinstance(x, str) else np.broadcast_to(x, len(lanes))[at[0]] for x in what]
            if what[0] != "bits" or what[1]:
                self.trace.write(self.trace.kind, self.name, *what, f"{self.state[self.traced[0]]:08x}")

    def gaussians(self, block=64):
        """Yield for each i the lanes that have a Gaussian i, and the numbers of these Gaussians."""
        n = len(self.length)
        for i in range(self.steps):
            while self.length[n - 1] <= i:
                n -= 1
            if i % block == 0:
                self.check_words()
            self.of(i)
            yield i, slice(0, n), self.first[:n] + i

    def check_words(self):
        check((self.next <= self.stop).all(), "a lane goes beyond its words")

    def finish(self):
        check((self.next == self.stop).all() and (self.state == 1 << 16).all(),
              "words of a lane are left, or its last state is not 2^16")

    def put(self, state, who):
        at, low = self.next[who], state < 1 << 16
        # A lane that goes beyond its words takes some others, until check_words finds it.
        self.state[who] = np.where(low, (state << 16) + self.words.take(at, mode="clip"), state)
        self.next[who] = at + low

    def symbol(self, stream, context, who):
        sets = self.set[who] + stream * 24 if stream < 16 else (stream + 32) * 24
        start = self.tables.start[sets + context]
        check(start.size == 0 or start.min() >= 0, "a context has no table")
        w = 12 if ATOM <= stream < ATOM + 3 else 10
        state = self.state[who]
        slot = start + (state & (1 << w) - 1)
        self.put((state >> w) * self.tables.p.take(slot) + self.tables.rest.take(slot), who)
        symbol = self.tables.symbol.take(slot)
        if len(self.traced):
            self.note(who, NAMES[stream], context, symbol)
        return symbol

    def bits(self, n, who):
        """Take n bits, n being a vector or one number."""
        value, shift = 0, 0
        while True:
            now, state = np.minimum(n, 16), self.state[who]
            piece = state & (1 << now) - 1
            value = value + (piece << shift)
            self.put(state >> now, who)
            if len(self.traced):
                self.note(who, "bits", now, piece)
            n, shift = n - now, shift + 16
            if not np.any(n):
                return value

    def integer(self, stream, context, who, top=30):
        t = self.symbol(stream, context, who)
        far = np.flatnonzero(t >= 16)
        if len(far):
            token = t[far]
            n = np.minimum((token - 16 >> 1) + 3, top)
            t[far] = ((2 + (token & 1)) << n) + self.bits(n, self.lane[who][far])
        return t

    def signed(self, stream, context, who):
        u = self.integer(stream, context, who)
        return np.where(u & 1, -(u + 1 >> 1), u >> 1)


def wrap(x):
    """Take integers modulo 2^32 into signed 32 bits."""
    return (x + (1 << 31) & (1 << 32) - 1) - (1 << 31)


def level(x):
    return np.clip(x + 256 >> 9, 0, 15)


def bitlength(x):
    return np.searchsorted(POWERS, x, side="right")


def drop(x, lack):
    return np.minimum(DROP[lack], x - 1)


def xyz_of(z):
    """Every third bit, from bits 0, 1 and 2 on: 21 bits of each coordinate, moved together in steps."""
    x = z >> np.arange(3, dtype=I)[:, None] & 0x1249249249249249
    for shift, mask in ((2, 0x10c30c30c30c30c3), (4, 0x100f00f00f00f00f), (8, 0x1f0000ff0000ff),
                        (16, 0x1f00000000ffff), (32, 0x1fffff)):
        x = (x ^ x >> shift) & mask
    return x


class Integers:
    """All that is decoded, one row a variable and one column a Gaussian of the file."""

    def __init__(self, n):
        self.z, self.cell = np.zeros(n, I), np.zeros((3, n), I)
        self.colour, self.shape, self.needle = (np.zeros(n, I) for _ in range(3))
        self.count, self.rotation = np.zeros((10, n), I), np.zeros((3, n), I)
        self.predicted = np.zeros((7, n), I)
        self.full, self.move_log, self.fineness = (np.zeros((3, n), I) for _ in range(3))
        self.lack, self.change = np.zeros(n, I), np.zeros((5, n), I)
        self.nonzeros, self.exact = np.zeros((3, n), I), np.zeros(n, bool)      # counts of each part
        self.codes = []                                  # of each part: Gaussian, atom and signed size of each nonzero
        self.rows = {}                                   # SH-rest of exact Gaussians, as bits


def decode_base(head, lanes, out):
    width = len(lanes.length)
    R = lanes.set // (16 * 24)
    C = 3 ** R
    z, g = np.zeros(width, I), np.zeros(width, I)
    cells, memory = np.zeros((16, 3, width), I), np.zeros((16, 9, width), I)
    for i, who, here in lanes.gaussians():
        a = len(here)
        gap = lanes.integer(CELL, np.minimum(g[who], 23), who, 61)
        z[who] += gap
        check((z[who] >= 0).all(), "Z is not below 2^63")            # below 2^63, else it has become negative
        g[who] = bitlength(gap)
        cell = xyz_of(z[who])

        used = min(i, 16)
        if used:
            D = np.minimum(abs(cell - cells[:used, :, who]), 1023)
            weight = 1 << 12 - np.minimum(np.frexp((4 * (D * D).sum(1) + 1).astype(float))[1], 12).astype(I)
            total = weight.sum(0)
            B = bitlength(total)
            inverse = (1 << 31) // (total << 16 - B)
            sums = (weight[:, None] * memory[:used, :, who]).sum(0)
            around = (sums + (1 << B - 1) >> B) * inverse >> 15
        else:
            around = np.concatenate([head.means, [0, 0]])[:, None].repeat(a, 1)

        colour = lanes.symbol(COLOUR, 1 + level(around[7]) if used else 0, who)
        check((colour <= 15).all(), "colour is not from 0 to 15")
        expected = np.clip(512 * colour + around[8], 0, 15 * 512)
        below = (expected - 128 >> 9) << 9
        shape = level(expected) + lanes.signed(SHAPE, 1 + level(2 * (expected - below)) if used else 0, who)
        check(((shape >= 0) & (shape <= 15)).all(), "shape is not from 0 to 15")

        features = np.zeros((9, a), I)
        known = np.zeros((6, a), I)                      # F; scales come as they are decoded
        known[1], known[2], s = 512 * colour, 512 * shape, known[3:]
        counts, predicted = [], []
        for t in range(7):
            P, steps = head.predictor[t], head.steps[min(t, 4)]
            known[0] = around[t]
            total = (P[0] << 8) + (P[1:, None] * known >> 4).sum(0)
            predicted.append(np.clip(total, -1 << 25, 1 << 25) << 3)
            counts.append(lanes.signed(TARGETS[t], shape if t < 4 else colour, who))
            step = steps[shape] if t < 4 else steps[colour] * C[who]
            features[t] = np.clip(wrap(predicted[t] + counts[t] * step) >> 11, -16383, 16383)
            if t < 3:
                s[t] = features[t]

        def slope(row):
            return row[0] + 512 * shape + (row[1:, None] * s >> 12).sum(0)
        q = [np.minimum(slope(row), 135) for row in head.turn]
        needle = s[0] - s[1] >= s[1] - s[2]
        axis_bits = np.clip(677 - (q[1] + np.where(needle, q[2], q[0]) >> 1) + 255 >> 9, 0, 15)
        turn_bits = np.clip(846 - np.where(needle, q[0], q[2]) + 255 >> 9, 0, 15)
        full = [axis_bits, axis_bits, turn_bits]
        move_log = [np.minimum(slope(row), 512 + (739 * s[0] >> 9)) for row in head.move]
        fineness = [np.clip(head.cell_log - x + 1152 >> 8, 0, 23) for x in move_log]
        rotation = [lanes.bits(x - drop(x, R[who]), who) for x in full]
        counts += [lanes.signed(POSITION + k, fineness[k], who) for k in range(3)]

        features[7], features[8] = 512 * colour, 512 * (shape - colour)
        cells[i % 16, :, who], memory[i % 16, :, who] = cell, features
        for where, value in ((out.z, z[who]), (out.cell, cell), (out.colour, colour), (out.shape, shape),
                             (out.needle, needle), (out.count, counts), (out.rotation, rotation),
                             (out.predicted, predicted), (out.full, full), (out.move_log, move_log),
                             (out.fineness, fineness)):
            where[..., here] = value


def decode_refinement(head, lanes, out):
    lack = lanes.set // (16 * 24)                        # before this refinement
    for _, who, here in lanes.gaussians():
        for j in range(4, 10):
            count = out.count[j, here]
            stream, context = (FINE_DC, out.colour[here] // 2) if j < 7 else (FINE_POSITION, out.fineness[j - 7, here] // 3)
            t = lanes.symbol(stream, 3 * context + np.minimum(abs(count), 2), who)
            check((t <= 2).all(), "a symbol of FineDc or FinePosition is above 2")
            out.count[j, here] = wrap(3 * count + np.where(count >= 0, t - 1, 1 - t))
        for j in range(3):
            full = out.full[j, here]
            y = drop(full, lack[who]) - drop(full, lack[who] - 1)
            out.rotation[j, here] = (out.rotation[j, here] << y) + lanes.bits(y, who)
        out.lack[here] = lack[who] - 1


def decode_interim(head, lanes, out):
    for _, who, here in lanes.gaussians():
        shape, colour = out.shape[here] // 2, out.colour[here] // 2
        first = out.change[0, here] = lanes.signed(INTERIM_SCALE, shape, who)
        out.change[1, here] = lanes.signed(INTERIM_OPACITY, 8 * np.minimum(abs(first), 2) + shape, who)
        for k in range(2, 5):
            out.change[k, here] = lanes.signed(INTERIM_DC, 8 * (k - 2) + colour, who)


def decode_part(head, p, lanes, out):
    top = head.least[p - 1] - head.least[p] if p else (1 << 30) - head.least[0]
    last = np.zeros(len(lanes.length), I)
    found, block = [[np.zeros(0, I)] * 3], []
    for i, who, here in lanes.gaussians():
        colour, exact = out.colour[here], out.exact[here]
        if p == 0:
            count = lanes.integer(COUNT, 2 * np.minimum(colour, 11) + (last[who] > 1), who)
            check((count <= head.d + 1).all(), "a count of part 0 is above d + 1")
            exact = out.exact[here] = count == head.d + 1
            count = last[who] = np.where(exact, 0, count)
        else:
            count, plain = np.zeros(len(here), I), np.flatnonzero(~exact)
            before = out.nonzeros[p - 1, here[plain]]
            count[plain] = lanes.integer(COUNT + p, 3 * (colour[plain] // 2) + np.minimum(before, 2), plain)
            check((count <= head.d).all(), "a count of nonzeros is above d")
        out.nonzeros[p, here] = count
        block.append((here, count, exact))
        if i % 64 == 63 or i == lanes.steps - 1:
            lanes.check_words()
            found.append(decode_nonzeros(head, p, lanes, block, top))
            if p == 0:
                decode_exact(head, lanes, block, out)
            block = []
    out.codes.append([np.concatenate(x) for x in zip(*found)])


def decode_nonzeros(head, p, lanes, block, top):
    """Decode the nonzeros of a block of each lane: return the Gaussian, atom and signed size of each."""
    counts = np.zeros((len(block[0][0]), len(block)), I)
    for k, (_, count, _) in enumerate(block):
        counts[:len(count), k] = count
    total = counts.sum(1)
    begin = np.cumsum(total) - total
    # Of each nonzero, lane by lane: which Gaussian of the block it belongs to, and whether it is that one's first.
    lane = np.repeat(np.arange(len(total)), total)
    each = np.repeat(np.arange(counts.size), counts.ravel())
    count = counts.ravel()[each]
    first = np.diff(each, prepend=-1) != 0
    atom, excess = np.zeros(len(each), I), np.zeros(len(each), I)
    begun = block[0][0][0] - lanes.first[0]
    traced = [x for x in lanes.traced if x < len(total)]
    of = [begun + each[begin[x]:begin[x] + total[x]] % len(block) for x in traced]
    for j in range(int(total.max())):
        who = np.flatnonzero(total > j)
        if of and j < len(of[0]):
            lanes.of(of[0][j])
        at = begin[who] + j
        page = lanes.symbol(PAGE, p, who) if head.m > 256 else 0
        atom[at] = 256 * page + lanes.symbol(ATOM + p, 2 * np.minimum(page, 3) + np.where(first[at], 0, 1), who)
        context = np.where(first[at], np.minimum(count[at] - 1, 7), 8 + np.minimum(excess[at - 1], 15))
        excess[at] = lanes.integer(VALUE + p, context, who)
    check((atom < head.m).all(), "an atom is not below m")
    check((excess < top).all(), "an excess is above the sizes of its part")
    size = excess + head.least[p]
    for j in range(0, int(total.max()), 16):
        who = np.flatnonzero(total > j)
        n = np.minimum(total[who] - j, 16)
        if of and j < len(of[0]):
            lanes.of(of[0][j], "-")
        signs = lanes.bits(n, who)
        for k in range(int(n.max())):
            negative = np.flatnonzero((n > k) & (signs >> k & 1 == 1))
            size[begin[who[negative]] + j + k] *= -1
    return lanes.first[lane] + begun + each % len(block), atom, size


def decode_exact(head, lanes, block, out):
    which = np.zeros((len(block[0][0]), len(block)), bool)
    for k, (_, _, exact) in enumerate(block):
        which[:len(exact), k] = exact
    of = [np.flatnonzero(x) for x in which]
    for j in range(max(map(len, of))):
        who = np.array([lane for lane, x in enumerate(of) if len(x) > j])
        for lane in np.intersect1d(who, lanes.traced):
            lanes.of(block[of[lane][j]][0][0] - lanes.first[0])
        rows = np.stack([lanes.bits(32, who) for _ in range(head.d)], 1).astype("<u4")
        for lane, row in zip(who, rows):
            check(np.isfinite(row.view("<f4")).all(), "an exact value is not finite")
            out.rows[int(block[of[lane][j]][0][lane])] = row


# Ranges

def decode_ranges(head, data, trace=None):
    """Decode the ranges that lie within data, which may be the beginning of packed.data. `trace` may be a Trace.

    Return the integers, the Gaussians that have a base, and of each range that was decoded whether the CRC-32 of its
    integers is right, as {(chunk, kind): (number of integers, whether)}.
    """
    n, chunks = int(head.first[-1]), range(len(head.count))
    out, sums = Integers(n), {}
    whole = {key for key, (start, length, *_) in head.ranges.items() if start + length <= len(data)}
    def run(kind_of, decoder, row_of, set_of=lambda c: 0):
        """Decode the range of kind kind_of(c) of every chunk c that has it and all that it needs."""
        keys = [(c, kind_of(c)) for c in chunks if kind_of(c) is not None and needs(c, kind_of(c)) <= whole]
        pieces = [(data[head.ranges[k][0]:head.ranges[k][0] + head.ranges[k][1]], int(head.first[k[0]]), head.count[k[0]],
                   set_of(k[0])) for k in keys]
        lanes = Lanes(head.tables, pieces, trace if (0, kind_of(0) if chunks else None) in keys else None)
        if lanes.trace:
            trace.kind = kind_of(0)
        decoder(lanes)
        lanes.finish()
        ends, values = row_of()
        for c, kind in keys:
            mine = values[ends[head.first[c]]:ends[head.first[c + 1]]].astype("<i4")
            sums[c, kind] = (len(mine), zlib.crc32(mine.tobytes()) == head.ranges[c, kind][3])

    def needs(c, kind):
        R = head.refinements[c]
        first = 1 if kind <= R else R + 1 if kind <= R + head.parts else kind
        return {(c, 0), *((c, k) for k in range(first, kind + 1))}

    for key in whole:
        start, length, crc, _ = head.ranges[key]
        check(not needs(*key) <= whole or zlib.crc32(data[start:start + length]) == crc, f"range {key} is damaged")

    def rows(*variables):
        values = np.vstack(variables).T
        return np.arange(n + 1) * values.shape[1], values.ravel()

    R = head.refinements
    for c in chunks:
        out.lack[head.first[c]:head.first[c + 1]] = R[c]
    run(lambda c: 0, lambda lanes: decode_base(head, lanes, out),
        lambda: rows(out.cell, out.colour, out.shape, out.count, out.rotation), lambda c: 16 * R[c])
    check(all(int(out.z[head.first[c]]) == head.cell[c] for c in chunks if (c, 0) in whole),
          "`cell` of the index is not that of the chunk's first Gaussian")
    for k in range(1, max(R, default=0) + 1):
        run(lambda c: k if k <= R[c] else None, lambda lanes: decode_refinement(head, lanes, out),
            lambda: rows(out.count, out.rotation), lambda c: 16 * (R[c] + 1 - k))
    for p in range(head.parts):
        run(lambda c: R[c] + 1 + p, lambda lanes: decode_part(head, p, lanes, out), lambda: part_rows(head, p, out))
    interim = [R[c] + head.parts + 1 for c in chunks]
    run(lambda c: interim[c] if (c, interim[c]) in head.ranges else None,
        lambda lanes: decode_interim(head, lanes, out), lambda: rows(out.change))
    there = np.zeros(n, bool)
    for c in chunks:
        there[head.first[c]:head.first[c + 1]] = (c, 0) in whole
    return out, there, sums


def part_rows(head, p, out):
    """The integers of a part, as the index has their CRC-32, and where those of each Gaussian begin."""
    who, atom, size = (x[np.argsort(out.codes[p][0], kind="stable")] for x in out.codes[p])
    exact = out.exact & (p == 0)
    count = out.nonzeros[p]
    ends = np.concatenate([[0], np.cumsum(1 + np.where(exact, head.d, 2 * count))])
    values = np.zeros(ends[-1], I)
    values[ends[:-1]] = np.where(exact, -1, count)
    at = ends[who] + 1 + 2 * (np.arange(len(who)) - (np.cumsum(count) - count)[who])
    values[at], values[at + 1] = atom, size
    for g, row in out.rows.items() if p == 0 else ():
        values[ends[g] + 1:ends[g + 1]] = row.view("<i4")
    return ends, values


# Values

def apply_interim(head, out, there, values):
    """Change values of Gaussians in whose cell the next layer has no base yet."""
    layers, cells = np.array(head.layer, I), np.array(head.cell, np.uint64)
    has = there[head.first[:-1]] if len(layers) else np.zeros(0, bool)
    layer_of = np.repeat(layers, head.count)
    for layer in range(int(layers.max(initial=0))):
        mine, chunks = np.flatnonzero(there & (layer_of == layer)), np.flatnonzero(layers == layer + 1)
        if not len(chunks):
            continue
        # Of several chunks that begin in one cell the last is responsible for it: those before it have no cell at all.
        which = np.searchsorted(cells[chunks], out.z[mine].astype(np.uint64), side="right") - 1
        mine = mine[~has[chunks[np.maximum(which, 0)]]]
        for t in range(7):
            change = out.change[max(t - 2, 0), mine] * head.interim_step[min(max(t - 2, 0), 2)]
            values[t, mine] = wrap(values[t, mine] + change)


def values_of(head, out, there):
    """Return all that is drawn of the Gaussians that have a base.

    `ideal` are the values before they are rounded to f32, and how far from these others may be.
    """
    H = 3 ** out.lack
    values = []
    for t in range(7):
        step = head.steps[min(t, 4)][out.shape if t < 4 else out.colour]
        values.append(wrap(out.predicted[t] + (out.count[t] if t < 4 else wrap(H * out.count[t])) * step))
    values = np.array(values).reshape(7, -1)
    apply_interim(head, out, there, values)
    values = values[:, there]
    check(((values >= -1 << 27) & (values < 1 << 27)).all(), "one of values is not from -2^27 to 2^27 - 1")
    lack, full = out.lack[there], out.full[:, there]
    size = 2.0 ** (full - drop(full, lack))
    i, j, h = (out.rotation[:, there] + 0.5) / size
    needle = out.needle[there] == 1

    x, y = i + j - 1, i - j
    u = np.stack([x, y, np.maximum(1 - abs(x) - abs(y), 0)])
    u = u / np.sqrt((u * u).sum(0))
    first = np.stack([1 - u[0] * u[0] / (1 + u[2]), -u[0] * u[1] / (1 + u[2]), -u[0]])
    second = np.stack([-u[0] * u[1] / (1 + u[2]), 1 - u[1] * u[1] / (1 + u[2]), -u[1]])
    v = np.cos(np.pi * h) * first + np.sin(np.pi * h) * second
    w = np.cos(np.pi * h) * second - np.sin(np.pi * h) * first
    axes = np.where(needle, [u, v, w], [v, w, u])
    c, s, g = np.cos(np.pi * h / 2), np.sin(np.pi * h / 2), 1 / np.sqrt(2 + 2 * u[2])
    W, X, Y, Z = (1 + u[2]) * g * c, (u[0] * s - u[1] * c) * g, (u[0] * c + u[1] * s) * g, (1 + u[2]) * g * s
    half = np.stack([W + X + Y + Z, X - W - Y + Z, Y - W - Z + X, Z - W - X + Y]) / 2
    rotation = np.where(needle, half, [W, X, Y, Z])

    moves = wrap(3 ** lack * out.count[7:, there]) * 2.0 ** (out.move_log[:, there] / 512)
    position = head.origin[:, None] + (out.cell[:, there] + 0.5) * head.side
    for k in range(3):
        position = position + moves[k] * axes[k]
    o = np.minimum(values[3], -105) / 2 ** 20
    opacity = o - np.log(-np.expm1(o))

    rest, exact = sh_rest(head, out, there)
    ideal = position
    with np.errstate(over="ignore"):
        position, unit = ideal.astype(F), 2.0 ** head.dc_exponent
    terms = [values[4 + k] / 2 ** 20 * unit * head.dc_axes[k][:, None] for k in range(3)]
    dc = head.dc_mean[:, None] + terms[0] + terms[1] + terms[2]
    summed = abs(terms[0]) + abs(terms[1]) + abs(terms[2])
    if len(head.points) and head.d:
        n = head.d // 3
        weight = np.zeros((n, len(lack)))
        for point in head.points:
            D = np.clip(position.astype(float) - point[:, None], -2.0 ** 60, 2.0 ** 60)
            weight += basis(*(D / np.sqrt((D * D).sum(0) + head.softening ** 2)))[:n]
        weight /= 0.28209479 * len(head.points)
        for k in range(3):
            mine = rest[:, k * n:k * n + n].T.astype(float)
            dc[k] -= (weight * mine).sum(0)
            summed[k] += 3 * abs(mine).sum(0)
    ideal = {"position": (ideal.T, 2.0 ** -20 * abs(moves).sum(0)[:, None] + 2.0 ** -23 * abs(ideal.T)),
             "rotation": (rotation.T, np.full((len(lack), 4), 2.0 ** -20)),
             "dc": (dc.T, 2.0 ** -18 * summed.T + 2.0 ** -22 * abs(head.dc_mean)),
             "opacity": (opacity, 2.0 ** -20 * np.maximum(1, abs(opacity)))}
    result = {"scale": (values[:3] / 2 ** 20).T.astype(F), "sh_rest": rest}
    with np.errstate(over="ignore"):
        result |= {k: np.ascontiguousarray(v.astype(F)) for k, (v, _) in ideal.items()}
    check(all(np.isfinite(x).all() for x in result.values()), "something decoded is not finite")
    return result | {"exact": exact, "dictionary": head.atoms, "ideal": ideal}


def sh_rest(head, out, there):
    n = len(out.z)
    rest = np.zeros((n, head.d), F)
    if head.d:
        who, atom, size = (np.concatenate(x) for x in zip(*out.codes))
        sort = np.lexsort((atom, who))
        who, atom, size = who[sort], atom[sort], size[sort]
        check(not ((np.diff(who) == 0) & (np.diff(atom) == 0)).any(), "a Gaussian has an atom twice")
        count = out.nonzeros.sum(0)
        check((count <= head.d).all(), "all parts of a Gaussian together have more than d nonzeros")
        with np.errstate(over="ignore"):
            steps = np.array([F(head.value_step) * (F(1) if head.promised else F(2) ** c) for c in range(16)], F)
            value = (size.astype(F) * steps[out.colour[who]]).astype(np.float16).astype(F)
        check(np.isfinite(value).all(), "a value is not finite")
        # The k-th nonzeros of all Gaussians together: each product and each sum is rounded to f32.
        rank = np.arange(len(who)) - (np.cumsum(count) - count)[who]
        for k in range(int(count.max(initial=0))):
            at = np.flatnonzero(rank == k)
            rest[who[at]] += value[at, None] * head.atoms[atom[at]]
        for g, row in out.rows.items():
            rest[g] = row.view("<f4")
    return rest[there], out.exact[there]


def basis(x, y, z):
    """The basis functions of SH of degrees 1 to 4 as in 3DGS. The argument may be shorter than 1."""
    xx, yy, zz, xy, yz, xz = x * x, y * y, z * z, x * y, y * z, x * z
    return np.array([
        -0.48860251 * y, 0.48860251 * z, -0.48860251 * x,
        1.0925484 * xy, -1.0925484 * yz, 0.31539157 * (2 * zz - xx - yy), -1.0925484 * xz, 0.5462742 * (xx - yy),
        -0.5900436 * y * (3 * xx - yy), 2.8906114 * xy * z, -0.4570458 * y * (4 * zz - xx - yy),
        0.37317634 * z * (2 * zz - 3 * xx - 3 * yy), -0.4570458 * x * (4 * zz - xx - yy), 1.4453057 * z * (xx - yy),
        -0.5900436 * x * (xx - 3 * yy),
        2.5033429 * xy * (xx - yy), -1.7701308 * yz * (3 * xx - yy), 0.9461747 * xy * (7 * zz - 1),
        -0.6690465 * yz * (7 * zz - 3), 0.10578555 * (zz * (35 * zz - 30) + 3), -0.6690465 * xz * (7 * zz - 3),
        0.47308734 * (xx - yy) * (7 * zz - 1), -1.7701308 * xz * (xx - 3 * yy),
        0.6258357 * (xx * (xx - 3 * yy) - yy * (3 * xx - yy))])


# Coded columns

def read_column(data, n):
    b = Bytes(data)
    kind = b.u8()
    check(kind < 8, "the type of a column is not from 0 to 7")
    kind = np.dtype(COLUMN_TYPES[kind])
    values = []
    for first in range(0, n, 65536):
        values.append(read_block(Bytes(b.take(b.unpack("I")[0])), min(65536, n - first), kind.itemsize))
    check(b.end(), "bytes follow the last block of a column")
    return np.concatenate([np.zeros(0, "<u8"), *values]).astype(f"<u{kind.itemsize}").view(kind)


def read_block(b, n, w):
    how = b.u8()
    if how == 0:
        values = np.full(n, int.from_bytes(b.take(w), "little"), "<u8")
    elif how == 4:
        size = b.unpack("H")[0] + 1
        check(size <= n, "C of a palette is above n")
        palette = numbers(b, b.u8(), size, w)
        indices = numbers(b, b.u8(), n, 1 if size <= 256 else 2)
        check((indices < size).all(), "an index of a palette is not below C")
        values = palette[indices.astype(I)]
    else:
        values = numbers(b, how, n, w)
    check(b.end(), "bytes follow what is in a block")
    return values


def numbers(b, how, c, w):
    check(1 <= how <= 3, "a filter of a column is not from 0 to 4, or that of numbers not from 1 to 3")
    if how == 1:
        return np.frombuffer(stream(b, c * w), f"<u{w}").astype("<u8")
    x = np.zeros(c, "<u8")
    for k in range(w):
        x |= np.frombuffer(stream(b, c), "u1").astype("<u8") << np.uint64(8 * k)
    if how == 3:
        half = x >> np.uint64(1)
        x = np.cumsum(np.where(x & np.uint64(1), ~half, half), dtype="<u8") & np.uint64((1 << 8 * w) - 1)
    return x


def stream(b, size):
    inflate = zlib.decompressobj(-15)
    try:
        data = inflate.decompress(b.take(b.unpack("I")[0]), size + 1)
        check(len(data) == size and inflate.eof and not inflate.unused_data and not inflate.unconsumed_tail,
              "a stream of a column is of another length")
    except zlib.error as e:
        raise LexiError(f"a stream of a column is damaged: {e}") from e
    return data
