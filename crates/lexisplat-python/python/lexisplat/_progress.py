"""Progress reports of long work."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Union

from ._arguments import wrong_type

#: Called with the stage, the units that are done, and the units in all or 0 if that is not known.
ProgressCallback = Callable[[str, int, int], object]
#: A callback; ``True`` for bars by tqdm, which must be installed; ``None`` or ``False`` for no reports.
Progress = Union[ProgressCallback, bool, None]


def reporter(progress: Progress) -> ProgressCallback | None:
    """The callback that ``progress`` means."""
    if progress is None or progress is False:
        return None
    if progress is True:
        return _Bars()
    if not callable(progress):
        raise wrong_type("progress", progress, "True, or a function of a stage, the units done and the units in all")
    return progress


class _Bars:
    """One bar of tqdm for each stage."""

    def __init__(self) -> None:
        try:
            from tqdm.auto import tqdm
        except ImportError:
            raise ImportError("progress=True needs tqdm: pip install tqdm, or give a callback") from None
        self._tqdm: Any = tqdm
        self._bar: Any = None
        self._stage = ""

    def __call__(self, stage: str, done: int, total: int) -> None:
        if self._bar is None or stage != self._stage or done < self._bar.n:
            if self._bar is not None:
                self._bar.close()
            self._stage = stage
            self._bar = self._tqdm(total=total or None, desc=stage, unit_scale=True, leave=False)
        self._bar.update(done - self._bar.n)
        if total and done >= total:
            self._bar.close()
            self._bar = None
