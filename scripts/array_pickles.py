"""Reads pickles of arrays without running what they name.

A pickle names functions, and Python's reader calls them. The readers here know the few names that arrays need, and
refuse a pickle that names another. Needs NumPy.
"""

import collections
import io
import math
import pickle

import numpy as np

try:
    from numpy._core.multiarray import _reconstruct  # NumPy 2
except ImportError:
    from numpy.core.multiarray import _reconstruct

# What NumPy's arrays name.
NUMPY_NAMES = {
    ("numpy", "ndarray"): np.ndarray,
    ("numpy", "dtype"): np.dtype,
    ("numpy.core.multiarray", "_reconstruct"): _reconstruct,
    ("numpy._core.multiarray", "_reconstruct"): _reconstruct,
}
# First number of a file of `torch.save` before PyTorch 1.6, and the version of its layout.
TORCH_MAGIC = 0x1950A86A20F9469CFC6C
TORCH_PROTOCOL = 1001
# Bytes of the count before the values of each storage.
COUNT_BYTES = 8


class _Reader(pickle.Unpickler):
    """Reads a pickle that names nothing but `names`, by module and name."""

    def __init__(self, file, names):
        super().__init__(file)
        self.names = names

    def find_class(self, module, name):
        try:
            return self.names[module, name]
        except KeyError:
            raise pickle.UnpicklingError(f"it names {module}.{name}, which arrays do not need") from None

    def persistent_load(self, pid):
        """A storage of PyTorch by its key, with its count of values."""
        kind, values, key, _device, count = pid[:5]
        if kind != "storage" or values is not np.float32:
            raise pickle.UnpicklingError(f"a {kind} of other values than 32-bit floats")
        return key, count


def load_numpy(data):
    """Returns what a pickle of NumPy arrays holds: dictionaries, lists and the like, of arrays, numbers and text."""
    return _Reader(io.BytesIO(data), NUMPY_NAMES).load()


def load_torch(data):
    """Returns the arrays of a file of `torch.save` before PyTorch 1.6 that holds a dictionary of 32-bit tensors."""
    file = io.BytesIO(data)
    names = {
        ("collections", "OrderedDict"): collections.OrderedDict,
        ("torch._utils", "_rebuild_tensor_v2"): lambda storage, start, shape, strides, *_: (storage, start, shape, strides),
        ("torch", "FloatStorage"): np.float32,
    }
    head = [_Reader(file, {}).load() for _ in range(2)]
    if head != [TORCH_MAGIC, TORCH_PROTOCOL]:
        raise pickle.UnpicklingError("not a file of torch.save before PyTorch 1.6")
    _Reader(file, {}).load()  # sizes of integers on the machine that wrote the file
    tensors = _Reader(file, names).load()
    storages = {}
    for key in _Reader(file, {}).load():
        count = int.from_bytes(file.read(COUNT_BYTES), "little")
        storages[key] = np.frombuffer(file.read(4 * count), "<f4")
    return {name: _tensor(storages, *tensor) for name, tensor in tensors.items()}


def _tensor(storages, storage, start, shape, strides):
    values, count = storages[storage[0]], storage[1]
    # A dimension of one entry may have any stride.
    dense = [math.prod(shape[i + 1 :]) for i in range(len(shape))]
    if len(values) != count or any(n > 1 and s != d for n, s, d in zip(shape, strides, dense)):
        raise pickle.UnpicklingError("a storage is cut, or a tensor does not lie row by row")
    return values[start : start + math.prod(shape)].reshape(shape)
