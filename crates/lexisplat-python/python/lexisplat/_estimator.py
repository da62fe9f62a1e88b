"""What :class:`lexisplat.DictionaryLearner` needs of scikit-learn, where that is not installed."""

from __future__ import annotations

import inspect
from typing import Any

import numpy as np
import numpy.typing as npt

from ._arguments import wrong_type
from ._errors import ParameterError


class Estimator:
    """Parameters by name, as scikit-learn's estimators have them."""

    n_features_in_: int

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """The parameters by name."""
        names = [name for name in inspect.signature(type(self)).parameters]
        return {name: getattr(self, name) for name in names}

    def set_params(self, **params: Any) -> Estimator:
        """Sets parameters by name."""
        known = self.get_params()
        for name, value in params.items():
            if name not in known:
                raise ValueError(f"{name}: one of {', '.join(known)}")
            setattr(self, name, value)
        return self

    def fit_transform(self, X: Any, y: Any = None, **options: Any) -> Any:
        """Fits to rows, and codes them."""
        return self.fit(X, y, **options).transform(X)  # type: ignore[attr-defined]

    def __getstate__(self) -> dict[str, Any]:
        return dict(self.__dict__)

    def __repr__(self) -> str:
        defaults = inspect.signature(type(self)).parameters
        changed = {name: v for name, v in self.get_params().items() if v != defaults[name].default}
        return f"{type(self).__name__}({', '.join(f'{name}={value!r}' for name, value in changed.items())})"


def validated(learner: Any, X: Any, reset: bool) -> npt.NDArray[Any]:
    """The rows of ``X`` as float32 or float64, of the length that the learner knows."""
    X = np.asarray(X)
    if X.dtype.kind not in "fiub":
        raise wrong_type("X", X, "rows of numbers")
    rows = np.ascontiguousarray(X, np.float32 if X.dtype == np.float32 else np.float64)
    if rows.ndim != 2 or 0 in rows.shape:
        raise ParameterError(f"X = an array of shape {rows.shape}: (n_samples, n_features), at least one of each")
    if reset:
        learner.n_features_in_ = rows.shape[1]
    elif rows.shape[1] != learner.n_features_in_:
        raise ParameterError(f"X = rows of {rows.shape[1]} values: {learner.n_features_in_} were learned")
    return rows


def is_fitted(learner: Any) -> None:
    """Refuses a learner without atoms."""
    if not hasattr(learner, "components_"):
        raise AttributeError(f"{type(learner).__name__} is not fitted yet: call fit first")
