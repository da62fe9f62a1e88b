"""What users pass: names and types are checked before any work, and errors have the names that users wrote."""

from __future__ import annotations

import difflib
import functools
import inspect
import math
import numbers
import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, ParamSpec, TypeVar

from ._errors import ParameterError, WrongTypeError

P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T")

#: Largest whole numbers that the native part takes for counts, seeds and sizes.
MOST_COUNT = (1 << 63) - 1
MOST_SEED = (1 << 64) - 1
#: Largest counts in 8 and 32 bits.
BYTE = (1 << 8) - 1
MOST_32 = (1 << 32) - 1
#: Names of the native part that users know by others.
_NAMES = {"tolerance": "tol", "positions": "means", "dc": "sh0", "sh_rest": "shN", "rotations": "quats"}
#: Units of sizes, as the program has them: powers of 1000 and of 1024.
_UNITS = {
    **{"": 1, "b": 1, "k": 10**3, "kb": 10**3, "m": 10**6, "mb": 10**6, "g": 10**9, "gb": 10**9},
    **{"kib": 1 << 10, "mib": 1 << 20, "gib": 1 << 30},
}
_SIZE = 'bytes, as 2_000_000, 2e6, "2MB" or "2MiB"'
#: Longest text of a value in messages.
_SHOWN = 80


def checked(**names: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Makes a function refuse arguments that it does not have by lexisplat's errors, and call those of the native part
    as users do: ``names`` has its own, by the name in the native part."""
    known = {**_NAMES, **names}

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        signature = inspect.signature(function)

        @functools.wraps(function)
        def call(*args: P.args, **kwargs: P.kwargs) -> R:
            try:
                signature.bind(*args, **kwargs)
            except TypeError as wrong:
                raise _wrong_call(function.__qualname__, signature, kwargs, wrong) from None
            try:
                return function(*args, **kwargs)
            except ParameterError as error:
                rename(error, known)
                raise

        return call

    return decorate


def rename(error: ParameterError, names: Mapping[str, str]) -> None:
    """Gives the parameter that ``error`` is about the name that ``names`` has for it."""
    name = names.get(error.name or "")
    text = str(error)
    if name is not None and text.startswith(f"{error.name} = "):
        error.args = (name + text[len(error.name or "") :],)
        error.name = name


def check_names(function: str, known: Iterable[str], given: Iterable[str]) -> None:
    """Refuses options that ``function`` does not have."""
    for name in given:
        if name not in known:
            raise unknown(function, name, known)


def unknown(function: str, name: str, known: Iterable[str]) -> WrongTypeError:
    """The error for an option that ``function`` does not have, with one that is like it."""
    near = difflib.get_close_matches(name, list(known), 1)
    hint = f"; did you mean {near[0]}?" if near else f": it has {', '.join(known)}"
    error = WrongTypeError(f"{function} has no option {name}{hint}")
    error.name = name
    return error


def _wrong_call(function: str, signature: inspect.Signature, kwargs: Mapping[str, Any], wrong: TypeError) -> WrongTypeError:
    function = function.removesuffix(".__init__")
    options = [name for name, one in signature.parameters.items() if name != "self" and one.kind is not one.VAR_KEYWORD]
    for name in kwargs:
        if name not in signature.parameters:
            return unknown(function, name, options)
    return WrongTypeError(f"{function}: {wrong}")


def wrong(name: str, value: object, expected: str) -> ParameterError:
    """The error for a value that is out of range."""
    return _named(ParameterError(f"{name} = {_shown(value)}: {expected}"), name, value)


def wrong_type(name: str, value: object, expected: str) -> WrongTypeError:
    """The error for a value of a wrong type."""
    kind, shown = type(value).__name__, _shown(value)
    error = WrongTypeError(f"{name} = {shown if kind in shown else f'{shown} ({kind})'}: {expected}")
    _named(error, name, value)
    return error


def _named(error: ParameterError, name: str, value: object) -> ParameterError:
    error.name, error.value = name, _shown(value)
    return error


def _shown(value: object) -> str:
    plain = (bytes, numbers.Number, tuple, list, dict)
    shown = str(value) if isinstance(value, (str, os.PathLike)) else repr(value) if isinstance(value, plain) else f"a {type(value).__name__}"
    return shown if len(shown) <= _SHOWN else f"{shown[: _SHOWN - 3]}..."


def flag(name: str, value: object) -> bool:
    """A choice of yes or no."""
    # NumPy's type is no subclass.
    if isinstance(value, bool) or type(value).__name__ in ("bool", "bool_"):
        return bool(value)
    raise wrong_type(name, value, "True or False")


def text(name: str, value: object, among: Sequence[str] = ()) -> str:
    """A text, one of ``among`` if that is not empty."""
    expected = f"one of {', '.join(among)}" if among else "text"
    if not isinstance(value, str):
        raise wrong_type(name, value, expected)
    if among and value not in among:
        raise wrong(name, value, expected)
    return value


def number(name: str, value: object) -> float:
    """A number."""
    if isinstance(value, numbers.Real) and not isinstance(value, bool):
        return float(value)
    raise wrong_type(name, value, "a number")


def count(name: str, value: object, most: int = MOST_COUNT) -> int:
    """A whole number from 0 to ``most``. A float that is whole is one."""
    if not isinstance(value, numbers.Real) or isinstance(value, bool):
        raise wrong_type(name, value, "a whole number")
    given: Any = value
    whole = int(given) if math.isfinite(given) else -1
    if whole != given or not 0 <= whole <= most:
        bounds = "0 or more" if most >= MOST_COUNT else f"0 to {most}"
        raise wrong(name, value, f"a whole number, {bounds}")
    return whole


def size(name: str, value: object) -> int:
    """A number of bytes: a whole number, or a text with a unit."""
    if not isinstance(value, str):
        if not isinstance(value, numbers.Real) or isinstance(value, bool):
            raise wrong_type(name, value, _SIZE)
        return count(name, value)
    parts = re.fullmatch(r"\s*([0-9][0-9_]*(?:\.[0-9]*)?(?:[eE][+-]?[0-9]+)?)\s*([a-zA-Z]*)\s*", value)
    unit = _UNITS.get(parts[2].lower()) if parts else None
    if parts is None or unit is None:
        raise wrong(name, value, _SIZE)
    found = float(parts[1]) * unit
    if not 1 <= found <= MOST_COUNT:
        raise wrong(name, value, f"{_SIZE}, 1 or more")
    return int(found)


def path(name: str, value: object) -> str | os.PathLike[str]:
    """The path of a file."""
    if isinstance(value, (str, os.PathLike)):
        return value
    raise wrong_type(name, value, "a path")


def several(check: Callable[..., T], name: str, value: Any, length: int, *more: Any) -> tuple[T, ...]:
    """So many values, each of which ``check`` passes."""
    try:
        given = list(value)
    except TypeError:
        raise wrong_type(name, value, f"{length} values") from None
    if len(given) != length or isinstance(value, str):
        raise wrong(name, value, f"{length} values")
    return tuple(check(name, one, *more) for one in given)


def limits(value: object) -> dict[str, int] | None:
    """Limits by name; the native part knows the names."""
    if value is None:
        return None
    if not isinstance(value, Mapping):
        raise wrong_type("limit", value, 'a dict, as {"gaussians": 5_000_000, "bytes": "4GB"}')
    return {text("limit", name): size(f"limit[{name!r}]", most) for name, most in value.items()}


def device(value: object) -> str:
    """What draws: a name, or the number of a GPU."""
    if isinstance(value, numbers.Integral) and not isinstance(value, bool):
        return str(int(value))
    return text("device", value)


def optional(check: Callable[..., T], name: str, value: object, *more: Any) -> T | None:
    """``None``, or what ``check`` says of the value."""
    return None if value is None else check(name, value, *more)
