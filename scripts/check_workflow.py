#!/usr/bin/env python3
"""Checks that the workflow files are YAML, and that the one of releases calls scripts/release on three systems.

It needs PyYAML. No forge has run the workflow, so this is all that is known of it.
"""

import pathlib
import sys

import yaml

WORKFLOWS = pathlib.Path(__file__).resolve().parent.parent / ".github/workflows"
SYSTEMS = {"ubuntu", "macos", "windows"}

for path in sorted(WORKFLOWS.glob("*.yml")):
    yaml.safe_load(path.read_text())
job = yaml.safe_load((WORKFLOWS / "release.yml").read_text())["jobs"]["release"]
systems = {name.split("-")[0] for name in job["strategy"]["matrix"]["system"]}
commands = [step["run"] for step in job["steps"] if "run" in step]
if systems != SYSTEMS or not any(command.startswith("python scripts/release ") for command in commands):
    sys.exit(f"release.yml runs {commands} on {systems}")
