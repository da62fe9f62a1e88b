"""The command ``lexisplat-ray``."""

from __future__ import annotations

import argparse
import json
import sys
import warnings
from collections.abc import Sequence
from typing import Any

from .._errors import (
    Error,
    FormatError,
    GpuError,
    IoError,
    LexisplatWarning,
    LimitError,
    ParameterError,
)

#: Exit statuses as those of the program, by the exception; those of options that do not exist are argparse's, 2.
STATUSES: list[tuple[type[BaseException], int]] = [
    (FileExistsError, 7),
    (IoError, 3),
    (FormatError, 4),
    (ParameterError, 5),
    (LimitError, 6),
    (GpuError, 8),
    (KeyboardInterrupt, 130),
    (Exception, 1),
]


def parser() -> argparse.ArgumentParser:
    made = argparse.ArgumentParser(
        prog="lexisplat-ray",
        description="Compress a scene of many tiles on all workers of Ray, into one .lexi file or one a tile. "
        "The file is that of `lexisplat compress` of the same tiles in parts.",
    )
    add = made.add_argument
    add("tiles", nargs="+", metavar="TILE", help="files of any format, patterns or folders; they may overlap")
    add("-o", "--output", required=True, metavar="PATH", help="the file, or with --one-each the folder")
    add("--preset", choices=["small", "balanced", "high", "archive"], help="about 35, 40, 45 or 54 dB of PSNR [balanced]")
    add("--psnr", type=float, metavar="DB", help="any other quality, in dB of PSNR")
    add("--tol", type=float, metavar="T", help="largest L2 norm of the error of a Gaussian's SH vector")
    add("--atoms", type=int, metavar="M", help="atoms of the dictionary, 1 to 1024")
    add("--seed", type=int, default=0, metavar="N", help="seed of the choice of Gaussians to learn from [0]")
    add("--keep-order", action="store_true", help="store the order of the source")
    add("--keep-all", action="store_true", help="leave no Gaussian out")
    add("--lod", action="store_true", help="add levels of detail: layers of fewer Gaussians, for parts that are far")
    add("--refine", type=_effort, metavar="EFFORT", help="fit everything to pictures of the parts: quick, thorough or minutes")
    add("--guess", action="store_true", help="estimate what shows instead of drawing: several times faster, larger files")
    add("--device", default="cpu", help="what draws on the workers: cpu, gpu, auto or a number [cpu]")
    add("--one-each", action="store_true", help="write a file for each tile, with one dictionary")
    add("--skip-bad", action="store_true", help="leave out tiles that cannot be read or do not fit, and list them")
    add("--drop-invalid", action="store_true", help="leave out Gaussians with NaN or infinite values")
    add("--drop-extras", action="store_true", help="leave out properties that 3DGS does not define")
    add("--overwrite", action="store_true", help="replace files that are there")
    add("--address", metavar="ADDRESS", help="the cluster, as ray.init takes it [this machine]")
    add("--workers", type=int, metavar="N", help="processors to use on this machine [all]")
    add("--threads", type=int, default=1, metavar="N", help="threads and processors of a task [1]")
    add("--json", action="store_true", help="print the report as JSON")
    add("-q", "--quiet", action="store_true", help="print no progress")
    return made


def _effort(text: str) -> str | float:
    return text if text in ("quick", "thorough") else float(text)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command. Returns the exit status."""
    given = parser().parse_args(arguments)
    try:
        report = _run(given)
    except (Error, ImportError, ConnectionError, KeyboardInterrupt) as error:
        print(f"error: {str(error) or 'interrupted'}", file=sys.stderr)
        return next(status for kind, status in STATUSES if isinstance(error, kind))
    print(json.dumps(report, indent=2) if given.json else _text(report))
    return 0


def _run(given: argparse.Namespace) -> dict[str, Any]:
    # First, for it says what to do where Ray is missing.
    from ._compress import compress

    import ray

    if given.address is not None and given.workers is not None:
        raise ParameterError(f"--workers = {given.workers}: not together with --address, whose workers are all used")
    here = {} if given.address else {"num_cpus": given.workers, "include_dashboard": False}
    ray.init(address=given.address or "local", log_to_driver=False, logging_level="error", **here)
    passed = (
        "preset psnr tol atoms seed keep_order keep_all lod refine guess device one_each skip_bad drop_invalid drop_extras overwrite threads"
    )
    options = {name: getattr(given, name) for name in passed.split()}
    with warnings.catch_warnings():
        warnings.showwarning = _warn  # type: ignore[assignment]
        warnings.simplefilter("always", LexisplatWarning)
        return compress(given.tiles, given.output, progress=None if given.quiet else _Lines(), **options)


def _warn(message: Warning | str, *_: object, **__: object) -> None:
    print(f"warning: {message}", file=sys.stderr)


class _Lines:
    """Progress on one line of a terminal, or a line for each stage elsewhere."""

    def __init__(self) -> None:
        self._stage = ""
        self._is_terminal = sys.stderr.isatty()

    def __call__(self, stage: str, done: int, total: int) -> None:
        if self._is_terminal:
            print(f"\r\033[K{stage}: {done:,} of {total:,}", end="", file=sys.stderr, flush=True)
            if done >= total:
                print("\r\033[K", end="", file=sys.stderr, flush=True)
        elif stage != self._stage:
            print(f"progress: {stage}, {total:,} parts", file=sys.stderr, flush=True)
        self._stage = stage


def _text(report: dict[str, Any]) -> str:
    files = report.get("files", [report])
    lines = []
    for own in files:
        each = own["file_bytes"] / max(own["gaussians"], 1)
        lines.append(
            f"wrote        {own['output']}: {own['gaussians']:,} Gaussians, {own['file_bytes']:,} bytes, {each:.2f} a Gaussian"
        )
    left = sum(own["removed"] for own in files)
    lines.append(f"left out     {left:,} Gaussians, which show least")
    lines += [f"skipped      {own['tile']}: {own['error']}" for own in report["skipped"]]
    moved = ", ".join(f"{name} {count:,}" for name, count in report["traffic"].items() if count)
    lines.append(f"traffic      {moved} bytes")
    lines.append(f"seconds      {report['seconds']:.1f}")
    return "\n".join(lines)
