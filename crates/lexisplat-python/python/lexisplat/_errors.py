"""Exceptions, split by who is to blame."""

from __future__ import annotations

import errno
from typing import Any


class Error(Exception):
    """Any failure of lexisplat."""


class IoError(Error, OSError):
    """The operating system refused to read or write a file. It has ``errno`` and ``filename``, as every ``OSError``."""

    def __reduce__(self) -> tuple[Any, ...]:
        return os_error, (self.errno, self.strerror, self.filename)


class _NotFound(IoError, FileNotFoundError):
    pass


class _Exists(IoError, FileExistsError):
    pass


class _Denied(IoError, PermissionError):
    pass


class _Folder(IoError, IsADirectoryError):
    pass


class FormatError(Error, ValueError):
    """The bytes are not what they claim to be. The file is at fault; ``file`` is its name."""

    file: str | None = None


class ParameterError(Error, ValueError):
    """An argument is out of range, or does not go with another. ``name`` and ``value`` say which."""

    name: str | None = None
    value: str | None = None


class WrongTypeError(ParameterError, TypeError):
    """An argument has a wrong type, or does not exist."""


class LimitError(Error, ValueError):
    """A file asks for more than a limit allows. ``limit={"gaussians": ...}`` raises or lowers limits."""


class GpuError(Error, RuntimeError):
    """There is no GPU, it is too small, or its driver refused. ``device="cpu"`` needs none."""


class LexisplatWarning(UserWarning):
    """Something about a file or a scene is odd, and did not prevent the work."""


def _name_as_users_do() -> None:
    """Lets tracebacks name the exceptions as users import them."""
    for kind in (_NotFound, _Exists, _Denied, _Folder):
        kind.__name__ = kind.__qualname__ = "IoError"
    files = (IoError, _NotFound, _Exists, _Denied, _Folder)
    for named in (Error, *files, FormatError, ParameterError, WrongTypeError, LimitError, GpuError, LexisplatWarning):
        named.__module__ = "lexisplat"


_name_as_users_do()


def os_error(number: int, text: str, filename: str) -> IoError:
    """The exception for an error of the operating system."""
    kinds: dict[int, type[IoError]] = {
        errno.ENOENT: _NotFound,
        errno.EEXIST: _Exists,
        errno.EISDIR: _Folder,
        errno.EACCES: _Denied,
        errno.EPERM: _Denied,
    }
    return kinds.get(number, IoError)(number, text, filename)
