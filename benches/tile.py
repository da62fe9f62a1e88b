#!/usr/bin/env python3
"""A larger scene of a real one: copies side by side, to measure time and memory.

    python3 benches/tile.py MODEL.ply COPIES OUT.ply

The model is a binary little-endian PLY of floats. Copies lie on a square grid in x and z, as far apart as
nine tenths of the model are wide.
"""

import array
import math
import sys


def main():
    source, copies, target = sys.argv[1], int(sys.argv[2]), sys.argv[3]
    data = open(source, "rb").read()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    lines = data[:end].decode().splitlines()
    names = [line.split()[2] for line in lines if line.startswith("property float ")]
    count = next(int(line.split()[2]) for line in lines if line.startswith("element vertex"))
    values = array.array("f")
    values.frombytes(data[end:])
    width = len(names)
    if len(values) != width * count:
        sys.exit(f"{source}: not a binary PLY of floats alone")
    columns = [names.index(axis) for axis in "xz"]

    def extent(column):
        sorted_values = sorted(values[column::width])
        return sorted_values[int(0.95 * (count - 1))] - sorted_values[int(0.05 * (count - 1))]

    pitch = [extent(column) for column in columns]
    side = math.ceil(math.sqrt(copies))
    header = data[:end].replace(b"element vertex %d" % count, b"element vertex %d" % (count * copies))
    with open(target, "wb") as out:
        out.write(header)
        for copy in range(copies):
            moved = array.array("f", values)
            for column, step, index in zip(columns, pitch, divmod(copy, side)):
                shift = step * index
                for at in range(column, len(moved), width):
                    moved[at] += shift
            moved.tofile(out)


main()
