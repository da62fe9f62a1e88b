"""Checks types: mypy --strict of the installed package and the examples, and its stubs against what they describe."""

import os
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
#: Modules that examples need and the gate does not install.
MISSING = ["torch", "viser", "gsplat", "ray.*", "scipy.*", "sklearn.*", "matplotlib.*", "nbclient.*", "nbformat.*", "pytest.*"]
#: Names that only the stub has, aliases of `Literal`, which stubtest takes for functions, and what scikit-learn makes.
ALLOWED = [
    r"lexisplat\._native\.CameraTuple",
    r"lexisplat\._native\._\w+",
    r"lexisplat\._native\.\w+\.__new__",
    r"lexisplat\._\w+\.(Format|Layout|Preset|Space)",
    r"lexisplat\.learn\._\w+",
    r"lexisplat\.ray\._\w+\.ray",
    r"lexisplat\.learn\.DictionaryLearner\.set_\w+",
]


def main(folder: Path) -> int:
    config, allowed = folder / "mypy.ini", folder / "allowed.txt"
    sections = "".join(f"[mypy-{name}]\nignore_missing_imports = True\nfollow_imports = skip\n" for name in MISSING)
    config.write_text(f"[mypy]\nstrict = True\nwarn_unused_ignores = False\ndisallow_untyped_decorators = False\n{sections}")
    allowed.write_text("\n".join(ALLOWED) + "\n")
    mypy = [sys.executable, "-m", "mypy", "--config-file", str(config), "--cache-dir", str(folder / "cache")]
    stubtest = ["--mypy-config-file", str(config), "--allowlist", str(allowed), "--ignore-unused-allowlist"]
    commands = [
        [*mypy, "-p", "lexisplat"],
        [*mypy, *map(str, sorted((HERE / "examples").glob("*.py")))],
        [sys.executable, "-m", "mypy.stubtest", "lexisplat", *stubtest],
    ]
    failed = 0
    for command in commands:
        print(" ".join(command), flush=True)
        failed |= subprocess.run(command, cwd=folder).returncode
    return failed


if __name__ == "__main__":
    import tempfile

    with tempfile.TemporaryDirectory() as scratch:
        sys.exit(main(Path(os.path.realpath(scratch))))
