"""What users pass for a file: a path, its bytes, or a file object."""

from __future__ import annotations

import os
from typing import IO, Any, Union

from ._arguments import wrong_type
from ._errors import ParameterError

#: A path, the bytes of a file, or a file that is open for reading in binary.
Source = Union[str, "os.PathLike[str]", bytes, bytearray, memoryview, IO[bytes]]


def is_source(given: object) -> bool:
    """Whether ``given`` names a file, or is one."""
    return isinstance(given, (str, bytes, bytearray, memoryview, os.PathLike)) or hasattr(given, "read")


def opened(argument: str, given: Any, name: str | None = None) -> tuple[str | os.PathLike[str] | bytes, str | None]:
    """What the native part takes for a file, and the name in messages if it is not the path.

    A file object is read from where it stands to its end.
    """
    if isinstance(given, (str, os.PathLike, bytes)):
        return given, name
    if isinstance(given, (bytearray, memoryview)):
        return bytes(given), name
    if not hasattr(given, "read"):
        raise wrong_type(argument, given, "a path, the bytes of a file, or a file object")
    if name is None:
        own = getattr(given, "name", None)
        name = own if isinstance(own, str) else None
    found = given.read()
    if isinstance(found, str):
        raise ParameterError(f"{argument} = {name or 'a file object'}: text; open the file in binary, with mode \"rb\"")
    return bytes(found), name


def shown(given: object, name: str | None) -> object:
    """What messages call the file."""
    return name if name is not None else given if isinstance(given, (str, os.PathLike)) else "bytes"
