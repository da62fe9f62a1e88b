#!/usr/bin/env python3
"""Fails if a Linux program needs more of a system than it may: `check_elf.py (--static | --glibc 2.17) PROGRAM`.

It needs pyelftools.
"""

import argparse
import sys

from elftools.elf.dynamic import DynamicSection
from elftools.elf.elffile import ELFFile
from elftools.elf.gnuversions import GNUVerNeedSection

# What glibc itself consists of; everything else is not on every system.
OF_GLIBC = ("libc.so", "libm.so", "libdl.so", "libpthread.so", "librt.so", "libutil.so", "ld-linux")
# Name of the versions of glibc's functions.
GLIBC = "GLIBC_"


def number(version):
    """2.17 as (2, 17)."""
    return tuple(int(part) for part in version.split("."))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    kind = parser.add_mutually_exclusive_group(required=True)
    kind.add_argument("--static", action="store_true", help="it must need no library")
    kind.add_argument("--glibc", help="it must need no library but glibc, of at most this version")
    parser.add_argument("program")
    arguments = parser.parse_args()
    with open(arguments.program, "rb") as file:
        elf = ELFFile(file)
        tags = [t for s in elf.iter_sections() if isinstance(s, DynamicSection) for t in s.iter_tags()]
        libraries = [tag.needed for tag in tags if tag.entry.d_tag == "DT_NEEDED"]
        needs = [s for s in elf.iter_sections() if isinstance(s, GNUVerNeedSection)]
        versions = [auxiliary.name for s in needs for _, names in s.iter_versions() for auxiliary in names]
    newest = max((number(v.removeprefix(GLIBC)) for v in versions if v.startswith(GLIBC)), default=(0,))
    shown = ".".join(map(str, newest))
    print(f"{arguments.program}: needs {', '.join(libraries) or 'no library'}; glibc {shown}")
    if arguments.static and libraries:
        sys.exit("it is not static")
    if arguments.glibc:
        foreign = [name for name in libraries if not name.startswith(OF_GLIBC)]
        if foreign or newest > number(arguments.glibc):
            sys.exit(f"it needs more than glibc {arguments.glibc}: {', '.join(foreign)}")


if __name__ == "__main__":
    main()
