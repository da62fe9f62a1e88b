"""The paper's part by itself: a dictionary of rows of any length, and sparse codes within a tolerance.

:class:`DictionaryLearner` follows scikit-learn. It is one of its estimators where scikit-learn is installed, and does
the same without it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, Union

import numpy as np
import numpy.typing as npt

from . import _native
from ._arguments import MOST_COUNT, checked, count, number, optional, text, wrong_type
from ._progress import Progress, reporter

#: Rows and codes are of the type that rows come in.
Rows = Union[npt.NDArray[np.float32], npt.NDArray[np.float64]]

if TYPE_CHECKING:
    from typing_extensions import Self

    from ._estimator import Estimator as _Base

    def _validated(learner: DictionaryLearner, X: Any, reset: bool) -> Rows: ...

    def _is_fitted(learner: DictionaryLearner) -> None: ...

else:
    try:
        import sklearn  # noqa: F401
    except ImportError:
        from ._estimator import Estimator as _Base
        from ._estimator import is_fitted as _is_fitted
        from ._estimator import validated as _validated
    else:
        from sklearn.base import BaseEstimator, ClassNamePrefixFeaturesOutMixin, TransformerMixin
        from sklearn.utils.validation import check_is_fitted as _is_fitted
        from sklearn.utils.validation import validate_data

        class _Base(ClassNamePrefixFeaturesOutMixin, TransformerMixin, BaseEstimator):
            @property
            def _n_features_out(self):
                return len(self.components_)

            def __sklearn_tags__(self):
                tags = super().__sklearn_tags__()
                tags.transformer_tags.preserves_dtype = ["float64", "float32"]
                return tags

        def _validated(learner, X, reset):
            types = [np.float64, np.float32]
            return np.require(validate_data(learner, X, reset=reset, dtype=types, order="C"), requirements=["A"])


__all__ = ["DictionaryLearner"]

#: Most rows that atoms are learned from (``DEFAULT_SAMPLE`` of the library).
DEFAULT_SAMPLE = 65_536
#: Seeds are below this.
_SEEDS = 1 << 32
#: Parameters by their names in the native part.
_NAMES = {"atoms": "n_components", "sample": "max_samples", "rows": "X", "factor": "forgetting"}


class DictionaryLearner(_Base):
    """Learns a dictionary of unit-norm atoms, and codes rows as few of them as a tolerance allows.

    Parameters
    ----------
    n_components : int, optional
        Atoms, 1 to 1024; twice the length of a row by default.
    tol : float, optional
        Largest L2 norm (not squared) of the error of a row.
    max_nonzeros : int, optional
        Most nonzeros in a code. With it ``tol`` may be exceeded, and ``tol=None`` leaves the cap alone.
    pursuit : {"ols", "omp"}
        Orthogonal least squares needs fewer atoms; orthogonal matching pursuit is the paper's.
    max_samples : int
        Most rows that atoms are learned from. Rows within the tolerance of 0 do not count.
    forgetting : float
        What :meth:`partial_fit` multiplies the sums of earlier rows with, 0 to 1.
    sparse_output : bool, optional
        Whether :meth:`transform` gives a ``scipy.sparse.csr_array`` or a dense array. By default it is sparse where SciPy
        is installed.
    random_state : int, RandomState or None
        Seed of the choice of rows; 0 if it is ``None``, so that the same rows give the same atoms.

    Attributes
    ----------
    components_ : (n_components, n_features) of float32
        The atoms, most used first.
    n_iter_ : int
        Rounds of learning, or calls of :meth:`partial_fit`.
    mean_nonzeros_ : float
        Mean nonzeros of rows that were not learned from.
    n_features_in_ : int
        Length of a row.

    Examples
    --------
    >>> import numpy as np
    >>> X = np.random.default_rng(0).normal(size=(1000, 12))
    >>> learner = DictionaryLearner(n_components=24, tol=2.0).fit(X)
    >>> codes = learner.transform(X)
    >>> bool(np.linalg.norm(learner.inverse_transform(codes) - X, axis=1).max() < 2.0 + 1e-5)
    True
    """

    components_: npt.NDArray[np.float32]
    n_iter_: int
    mean_nonzeros_: float

    @checked()
    def __init__(
        self,
        n_components: int | None = None,
        tol: float | None = 0.1,
        *,
        max_nonzeros: int | None = None,
        pursuit: Literal["ols", "omp"] = "ols",
        max_samples: int = DEFAULT_SAMPLE,
        forgetting: float = 1.0,
        sparse_output: bool | None = None,
        random_state: Any = None,
    ) -> None:
        self.n_components = n_components
        self.tol = tol
        self.max_nonzeros = max_nonzeros
        self.pursuit = pursuit
        self.max_samples = max_samples
        self.forgetting = forgetting
        self.sparse_output = sparse_output
        self.random_state = random_state

    @checked(**_NAMES)
    def fit(self, X: Any, y: Any = None, *, progress: Progress = None) -> Self:
        """Learns the atoms from rows (n_samples, n_features). ``y`` is ignored."""
        self._learn(_validated(self, X, True), progress)
        self._statistics: _native.Statistics | None = None
        return self

    @checked(**_NAMES)
    def partial_fit(self, X: Any, y: Any = None, *, progress: Progress = None) -> Self:
        """Refits the atoms to these rows and all before (online dictionary learning, Mairal et al. 2010).

        The first call learns the atoms as :meth:`fit` does. Between calls only sums are kept, no rows.
        """
        first = not hasattr(self, "components_")
        rows = _validated(self, X, first)
        if first:
            self._learn(rows, progress)
            self.n_iter_ = 0
        rule, report = self._rule(), reporter(progress)
        sums = _native.Statistics.of(self.components_, rows, rule=rule, progress=report)
        before = getattr(self, "_statistics", None)
        self._statistics = sums if before is None else before.scaled(number("forgetting", self.forgetting)).plus(sums)
        if not first:
            self.components_ = self._statistics.update(self.components_)
        if sums.rows:
            self.mean_nonzeros_ = sums.nonzeros / sums.rows
        self.n_iter_ += 1
        return self

    @checked(**_NAMES)
    def transform(self, X: Any, *, progress: Progress = None) -> Any:
        """Codes rows: (n_samples, n_components), as float32 if the rows are, else as float64.

        A row that no code brings within ``tol`` has the code that comes nearest. Without ``max_nonzeros`` that is a row
        that lies farther than ``tol`` from all that the atoms span, or one of float32 whose codes cannot be told finely enough.
        """
        if not hasattr(self, "components_"):
            _is_fitted(self)
        rows = _validated(self, X, False)
        components = np.require(self.components_, np.float32, ["C", "A"])
        starts, atoms, values, _, _ = _native.encode_rows(
            components, rows, rule=self._rule(), progress=reporter(progress)
        )
        shape = (len(rows), len(self.components_))
        sparse = self.sparse_output
        if sparse is not False:
            try:
                from scipy.sparse import csr_array  # type: ignore[import-untyped, unused-ignore]
            except ImportError:
                if sparse:
                    raise
            else:
                return csr_array((values, atoms, starts), shape=shape)
        dense = np.zeros(shape, rows.dtype)
        dense[np.repeat(np.arange(len(rows)), np.diff(starts)), atoms] = values
        return dense

    def inverse_transform(self, X: Any) -> Rows:
        """Rows of codes: (n_samples, n_features), of the type of the codes. They are summed in float64."""
        _is_fitted(self)
        rows = np.asarray(X @ np.asarray(self.components_, np.float64))
        return rows.astype(np.float32) if X.dtype == np.float32 else rows

    def _learn(self, rows: Rows, progress: Progress) -> None:
        self.components_, self.n_iter_, _, self.mean_nonzeros_ = _native.learn_rows(
            rows,
            atoms=optional(count, "n_components", self.n_components),
            rule=self._rule(),
            seed=_seed(self.random_state),
            sample=count("max_samples", self.max_samples),
            progress=reporter(progress),
        )

    def _rule(self) -> tuple[float | None, int | None, str]:
        return (
            optional(number, "tol", self.tol),
            optional(count, "max_nonzeros", self.max_nonzeros),
            text("pursuit", self.pursuit),
        )

    def __getstate__(self) -> dict[str, Any]:
        state = dict(super().__getstate__())
        sums = state.get("_statistics")
        if sums is not None:
            state["_statistics"] = sums.to_bytes()
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        sums = state.get("_statistics")
        if sums is not None:
            state = {**state, "_statistics": _native.Statistics.from_bytes(sums)}
        parent = getattr(super(), "__setstate__", None)
        if parent is None:
            self.__dict__.update(state)
        else:
            parent(state)


def _seed(random_state: Any) -> int:
    if random_state is None:
        return 0
    if isinstance(random_state, (int, np.integer)):
        return count("random_state", random_state, MOST_COUNT)
    draw = getattr(random_state, "integers", None) or getattr(random_state, "randint", None)
    if draw is None:
        raise wrong_type("random_state", random_state, "a whole number, a generator of random numbers, or None")
    return int(draw(_SEEDS, dtype=np.int64))
