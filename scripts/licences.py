#!/usr/bin/env python3
"""Lists the packages whose code is in lexisplat's program, wheel or npm package, with their licences and the texts.

    python3 scripts/licences.py [--target TRIPLE]... [--output FILE]

The packages are those that the program, the Python module and the WebAssembly use for the targets, by default this
machine's and WebAssembly. What only builds and tests use is left out. It needs cargo and the packages' sources, which
`cargo fetch --locked` brings, and nothing else. It fails if a package states no licence, or one that deny.toml does not
allow.
"""

import argparse
import collections
import json
import os
import pathlib
import re
import subprocess
import sys
import tomllib

ROOT = pathlib.Path(__file__).resolve().parent.parent
# The packages whose builds are handed out.
SHIPPED = ["lexisplat-cli", "lexisplat-python", "lexisplat-web"]
WASM = "wasm32-unknown-unknown"
# Names of files with licences, which may have other words after them.
TEXT_NAME = re.compile(r"(LICEN[CS]E|COPYING|NOTICE|UNLICENSE|OFL|UFL)", re.IGNORECASE)
# Names of files of code that begin like the above.
CODE_NAME = re.compile(r"\.(rs|py|toml|json|h|c)$", re.IGNORECASE)
# Parts of every release that are no packages.
OTHERS = """\
Rust's standard library    MIT OR Apache-2.0    https://github.com/rust-lang/rust
musl (static program)      MIT                  https://musl.libc.org
"""


def cargo(*arguments):
    """The output of cargo, as text."""
    command = [os.environ.get("CARGO", "cargo"), *arguments]
    return subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout


def host():
    """The triple of this machine."""
    told = subprocess.run(["rustc", "-vV"], cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout
    return re.search(r"^host: (.*)$", told, re.MULTILINE).group(1)


def shipped_packages(target):
    """The packages that SHIPPED are linked from for `target`, without lexisplat's own: {id: package}."""
    text = cargo("metadata", "--format-version", "1", "--locked", "--offline", "--filter-platform", target)
    metadata = json.loads(text)
    packages = {package["id"]: package for package in metadata["packages"]}
    nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
    own = set(metadata["workspace_members"])
    wait = [i for i in own if packages[i]["name"] in SHIPPED]
    seen = set(wait)
    while wait:
        for dependency in nodes[wait.pop()]["deps"]:
            linked = any(kind["kind"] is None for kind in dependency["dep_kinds"])
            macro = any("proc-macro" in t["kind"] for t in packages[dependency["pkg"]]["targets"])
            if linked and not macro and dependency["pkg"] not in seen:
                seen.add(dependency["pkg"])
                wait.append(dependency["pkg"])
    return {i: packages[i] for i in seen - own}


def alternatives(licence):
    """The licences of an expression, whichever of them holds; "/" is an old way to write OR."""
    return {word.strip(" ()") for word in re.split(r" OR | AND |/", licence)}


def check(packages):
    """Fails if a package has no licence that deny.toml allows."""
    policy = tomllib.loads((ROOT / "deny.toml").read_text())["licenses"]
    exceptions = {e["crate"]: set(e["allow"]) for e in policy["exceptions"]}
    for package in packages:
        allowed = set(policy["allow"]) | exceptions.get(package["name"], set())
        parts = (package["license"] or "").split(" AND ")
        if not all(alternatives(part) & allowed for part in parts):
            sys.exit(f"{package['name']} {package['version']}: licence {package['license']} is not in deny.toml")


def texts(package):
    """The texts of licences in a package's source, in the order of their names."""
    folder = pathlib.Path(package["manifest_path"]).parent
    files = [f for f in sorted(folder.rglob("*")) if TEXT_NAME.match(f.name) and not CODE_NAME.search(f.name)]
    found = [f.read_text(errors="replace") for f in files if f.is_file()]
    return ["\n".join(line.rstrip() for line in text.strip().splitlines()) for text in found]


def own_text(package):
    """What stands in for the text of a package without one: Apache-2.0 if it may be chosen, or a notice by its authors."""
    if "Apache-2.0" in alternatives(package["license"]):
        return (ROOT / "LICENSE-APACHE").read_text().strip()
    authors = ", ".join(package["authors"]) or f"the authors of {package['repository']}"
    notice = re.sub(r"Copyright .*", f"Copyright (c) {authors}", (ROOT / "LICENSE-MIT").read_text())
    return f"(The package has no text. It states: {package['license']}.)\n\n{notice.strip()}"


def report(packages):
    """The list, and below it each text once with the packages that it is of."""
    lines = ["Packages whose code is in lexisplat, which is itself MIT OR Apache-2.0.", ""]
    width = max(len(f"{p['name']} {p['version']}") for p in packages)
    for package in packages:
        name = f"{package['name']} {package['version']}".ljust(width)
        lines.append(f"{name}  {package['license']}  {package['repository'] or ''}".rstrip())
    lines += ["", "And:", "", OTHERS]
    users = collections.defaultdict(list)
    for package in packages:
        for text in texts(package) or [own_text(package)]:
            users[text].append(f"{package['name']} {package['version']}")
    for text, names in users.items():
        lines += ["=" * 100, *names, "-" * 100, text, ""]
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--target", action="append", help="triple to list the packages of; may be given again")
    parser.add_argument("--output", type=pathlib.Path, help="file to write; by default standard output")
    arguments = parser.parse_args()
    found = {}
    for target in arguments.target or [host(), WASM]:
        found |= shipped_packages(target)
    packages = sorted(found.values(), key=lambda p: (p["name"], p["version"]))
    check(packages)
    text = report(packages)
    if arguments.output:
        arguments.output.write_text(text)
        print(f"{arguments.output}: {len(packages)} packages")
    else:
        print(text)


if __name__ == "__main__":
    main()
