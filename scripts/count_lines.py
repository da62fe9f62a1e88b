#!/usr/bin/env python3
"""Counts the lines of Rust in `crates/*/src` that are neither tests, comments nor blank.

    python3 scripts/count_lines.py [ROOT]

A line counts if something other than white space and comments stands on it. Left out are `tests.rs`, `testing.rs`,
`tests/` and `testing/`, and items under `#[cfg(test)]`.
"""

import pathlib
import re
import sys


def without_comments(text):
    """The text with comments, and the contents of strings, replaced by nothing; line breaks stay."""
    pattern = re.compile(
        r'//[^\n]*|/\*.*?\*/|b?r(#*)".*?"\1|b?"(?:\\.|[^"\\])*"|b?\'(?:\\.[^\']*|[^\'\\])\'', re.DOTALL
    )

    def blank(match):
        found = match.group(0)
        breaks = "\n" * found.count("\n")
        if found.startswith(("//", "/*")):
            return breaks
        # A string of several lines counts as that many.
        return '""' + breaks.replace("\n", '\n""')

    return pattern.sub(blank, text)


def without_tests(text):
    """`text` without the items that `#[cfg(test)]` stands before."""
    out = []
    rest = text
    while True:
        found = re.search(r"#\[cfg\(test\)\]", rest)
        if not found:
            return "".join(out) + rest
        out.append(rest[: found.start()])
        rest = rest[found.end() :]
        depth = 0
        for i, char in enumerate(rest):
            if char == "{":
                depth += 1
            elif char == "}":
                depth -= 1
                if depth == 0:
                    rest = rest[i + 1 :]
                    break
            elif char == ";" and depth == 0:
                rest = rest[i + 1 :]
                break


def main():
    root = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    total = 0
    for crate in sorted((root / "crates").iterdir()):
        lines = 0
        for path in sorted((crate / "src").rglob("*.rs")):
            parts = path.relative_to(crate).parts
            if {"tests", "testing"} & set(parts[:-1]) or parts[-1] in ("tests.rs", "testing.rs"):
                continue
            text = without_tests(without_comments(path.read_text()))
            lines += sum(1 for line in text.splitlines() if line.strip())
        print(f"{lines:6} {crate.name}")
        total += lines
    print(f"{total:6} in all")


if __name__ == "__main__":
    main()
