"""Copies, by the resident memory of a process of its own."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import lexisplat as lx
import pytest
from conftest import make

#: Prints what the arrays take, and by how much the peak grew in multiples of that.
MEASURE = """
import sys
import lexisplat as lx

def resident(what):
    with open("/proc/self/status") as status:
        return next(int(line.split()[1]) * 1024 for line in status if line.startswith(what))

def start():
    "What is resident now; the peak is counted from here on."
    with open("/proc/self/clear_refs", "w") as peak:
        peak.write("5")
    return resident("VmRSS:")

lx.save(sys.argv[2] + "/warm.ply", lx.load(sys.argv[1])[:10])
splats = lx.load(sys.argv[1])
before = start()
{work}
print((resident("VmHWM:") - before) / splats.nbytes)
"""


def grown(work: str, path: Path, folder: Path) -> float:
    script = MEASURE.format(work=work)
    done = subprocess.run([sys.executable, "-c", script, path, folder], check=True, capture_output=True, text=True)
    return float(done.stdout)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="/proc is there")
def test_resident_memory(tmp_path: Path) -> None:
    lx.save(tmp_path / "large.ply", make(400_000))
    path = tmp_path / "large.ply"
    # Out: the arrays, which are those that were read into, and pages of the file, which the system drops if it has to.
    assert 1.9 < grown("more = lx.load(sys.argv[1])", path, tmp_path) < 2.15
    assert grown("arrays = splats.to_dict(contiguous=False)", path, tmp_path) < 0.05
    # In: one copy of every array, and a buffer.
    assert 0.9 < grown("lx.save(sys.argv[2] + '/out.ply', splats)", path, tmp_path) < 1.15
    # With SH in gsplat's order, which is turned while it is copied, too.
    work = "splats.shN = splats.to_dict()['shN']\nbefore = start()\nlx.save(sys.argv[2] + '/out.ply', splats)"
    assert grown(work, path, tmp_path) < 1.15
