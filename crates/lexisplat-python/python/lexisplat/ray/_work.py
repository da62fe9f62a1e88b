"""Hands tasks to Ray, waits for them, counts what passes, and tells of progress."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import ray
from ray.exceptions import RayError, RayTaskError

from .._progress import ProgressCallback
from ._tasks import Context

#: Times that Ray runs a task again whose worker was lost. A scene is not given up for a machine that restarts.
RETRIES = 10


class Work:
    """The tasks of one scene."""

    def __init__(self, context: Context, progress: ProgressCallback | None) -> None:
        self.context = ray.put(context)
        self._threads = context.threads
        self._progress = progress
        self._pending: set[Any] = set()
        self._remotes: dict[Callable[..., Any], Any] = {}
        #: Bytes that passed between processes: statistics and what all tasks take, what is remembered of each Gaussian, scattered
        #: rows, and coded buckets.
        self.traffic = {"statistics": 0, "state": 0, "scattered": 0, "results": 0}
        #: Seconds of each stage, from the first word of it to the first of the next.
        self.stages: dict[str, float] = {}
        self._stage, self._since = "open", time.monotonic()

    def shared(self, message: bytes) -> Any:
        """A reference to bytes that several tasks take."""
        self.traffic["statistics"] += len(message)
        return ray.put(message)

    def start(self, task: Callable[..., Any], *arguments: Any, returns: int = 1, **options: Any) -> Any:
        """Starts a task. Returns references to what it gives."""
        # Ray sends a function to all workers each time one is made of it.
        if task not in self._remotes:
            self._remotes[task] = ray.remote(num_cpus=self._threads, max_retries=RETRIES, **self._several())(task)
        refs = self._remotes[task].options(num_returns=returns, **options).remote(self.context, *arguments)
        # One of them is enough to cancel the task; the others are freed when those who asked drop them.
        self._pending.add(refs[0] if returns > 1 else refs)
        return refs

    def _several(self) -> dict[str, Any]:
        """What tasks of several threads need: processes of their own, which begin with as many."""
        if self._threads == 1:
            return {}
        return {"runtime_env": {"env_vars": {"RAYON_NUM_THREADS": str(self._threads)}}}

    def results(self, stage: str, refs: Sequence[Any]) -> list[Any]:
        """What all of ``refs`` give, in order. The first failure ends the wait."""
        found: dict[Any, Any] = {}
        left = list(refs)
        self.tell(stage, 0, len(refs))
        while left:
            ready, left = ray.wait(left, num_returns=1)
            found[ready[0]] = self.get(ready[0])
            self.tell(stage, len(found), len(refs))
        return [found[ref] for ref in refs]

    def get(self, ref: Any) -> Any:
        """What ``ref`` gives. What a task raised is raised as if it had been done here."""
        self._pending.discard(ref)
        try:
            return ray.get(ref)
        except RayTaskError as error:
            cause = error.cause
            if isinstance(cause, Exception) and not isinstance(cause, RayError):
                raise cause from None
            raise

    def tell(self, stage: str, done: int, total: int) -> None:
        if stage != self._stage:
            self.end_stage()
            self._stage = stage
        if self._progress is not None:
            self._progress(stage, done, total)

    def end_stage(self) -> None:
        """Ends the stage, and its seconds."""
        now = time.monotonic()
        self.stages[self._stage] = self.stages.get(self._stage, 0.0) + now - self._since
        self._since = now

    def cancel(self) -> None:
        """Cancels what was started and not waited for."""
        for ref in self._pending:
            try:
                ray.cancel(ref)
            except (ValueError, TypeError, RayError):
                continue
        self._pending.clear()
