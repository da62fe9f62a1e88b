"""The dictionary by itself."""

from __future__ import annotations

import pickle
import subprocess
import sys

import lexisplat as lx
import numpy as np
import pytest
from lexisplat.learn import DictionaryLearner


def made(rows: int, length: int, atoms: int, nonzeros: int, seed: int = 0) -> np.ndarray:
    """Rows that few of some hidden atoms make up."""
    random = np.random.default_rng(seed)
    hidden = random.normal(size=(atoms, length))
    hidden /= np.linalg.norm(hidden, axis=1, keepdims=True)
    codes = np.zeros((rows, atoms))
    for code in codes:
        code[random.choice(atoms, nonzeros, replace=False)] = random.normal(size=nonzeros)
    return (codes @ hidden).astype(np.float32)


def dense(codes: object) -> np.ndarray:
    return codes.toarray() if hasattr(codes, "toarray") else np.asarray(codes)


@pytest.mark.parametrize("length", [1, 2, 7, 45, 64, 300])
def test_rows_of_any_length_are_coded_within_the_tolerance(length: int) -> None:
    X = made(400, length, 2 * length, min(3, length))
    learner = DictionaryLearner(n_components=2 * length, tol=0.2).fit(X)
    assert learner.components_.shape == (2 * length, length) and learner.n_features_in_ == length
    np.testing.assert_allclose(np.linalg.norm(learner.components_, axis=1), 1, atol=1e-5)
    codes = learner.transform(X)
    errors = np.linalg.norm(learner.inverse_transform(codes) - X, axis=1)
    assert codes.shape == (400, len(learner.components_)) and errors.max() <= 0.2 + 1e-6


@pytest.mark.parametrize(
    ("offset", "scale", "tol"), [(0, 1, 1e-5), (1e4, 1, 0.1), (0, 1e15, 1e14), (0, 1e200, 1e195), (0, 1e-20, 1e-22)]
)
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_rows_of_any_size_are_within_the_tolerance(offset: float, scale: float, tol: float, dtype: type) -> None:
    if scale > 1e30 and dtype == np.float32:
        pytest.skip("float32 has no such numbers")
    X = ((np.random.default_rng(0).normal(size=(500, 12)) + offset) * scale).astype(dtype)
    learner = DictionaryLearner(tol=tol).fit(X)
    np.testing.assert_allclose(np.linalg.norm(learner.components_, axis=1), 1, atol=1e-5)
    codes = dense(learner.transform(X))
    assert codes.dtype == dtype
    left = codes.astype(np.float64) @ learner.components_.astype(np.float64) - X.astype(np.float64)
    assert np.linalg.norm(left / tol, axis=1).max() <= 1
    # A tolerance that no code keeps gives the nearest, not none.
    learner.tol = tol * 1e-14
    left = dense(learner.transform(X)).astype(np.float64) @ learner.components_ - X.astype(np.float64)
    assert np.linalg.norm(left / tol, axis=1).max() <= 1


def test_learning_finds_what_rows_are_made_of() -> None:
    X = made(6000, 20, 30, 2)
    learner = DictionaryLearner(n_components=30, tol=0.1).fit(X)
    random = np.random.default_rng(1).normal(size=(30, 20)).astype(np.float32)
    random /= np.linalg.norm(random, axis=1, keepdims=True)
    found = (dense(learner.transform(X)) != 0).sum(1).mean()
    learner.components_ = random
    assert found < 3 and (dense(learner.transform(X)) != 0).sum(1).mean() > 3 * found


def test_the_cap_is_kept() -> None:
    X = made(300, 20, 30, 6)
    learner = DictionaryLearner(n_components=30, tol=None, max_nonzeros=2).fit(X)
    assert (dense(learner.transform(X)) != 0).sum(1).max() == 2
    omp = DictionaryLearner(n_components=30, tol=0.2, pursuit="omp").fit(X)
    assert omp.mean_nonzeros_ > 0 and omp.n_iter_ > 0


def test_parts_are_learned_from_one_after_the_other() -> None:
    X = made(8000, 20, 30, 2)
    whole = DictionaryLearner(n_components=30, tol=0.1).fit(X)
    parts = DictionaryLearner(n_components=30, tol=0.1)
    means = []
    for start in range(0, 8000, 1000):
        parts.partial_fit(X[start : start + 1000])
        means.append((dense(parts.transform(X)) != 0).sum(1).mean())
    assert parts.n_iter_ == 8 and means[-1] <= means[0]
    assert means[-1] < 1.5 * (dense(whole.transform(X)) != 0).sum(1).mean()
    again = pickle.loads(pickle.dumps(parts)).partial_fit(X[:1000])
    np.testing.assert_array_equal(again.components_, parts.partial_fit(X[:1000]).components_)
    with pytest.raises(ValueError, match="19"):
        parts.partial_fit(X[:, :19])


def test_the_same_rows_give_the_same_atoms() -> None:
    X = made(500, 10, 20, 2)
    first, second = (DictionaryLearner(tol=0.3).fit(X).components_ for _ in range(2))
    np.testing.assert_array_equal(first, second)
    assert not np.array_equal(first, DictionaryLearner(tol=0.3, random_state=1).fit(X).components_)
    drawn = DictionaryLearner(tol=0.3, random_state=np.random.default_rng(5)).fit(X).components_
    assert not np.array_equal(first, drawn)


def test_it_is_what_scenes_are_compressed_with(splats: lx.Splats) -> None:
    rows = splats.shN.transpose(0, 2, 1).reshape(-1, 45)
    codes = DictionaryLearner(tol=0.1).fit(rows).transform(rows)
    assert (dense(codes) != 0).sum(1).mean() < 1.05 * lx.compress(splats, tol=0.1).info["nonzeros"] / len(rows)


@pytest.mark.parametrize(
    "X",
    [np.zeros((5, 4)), np.ones((5, 4)), np.eye(4), np.ones((1, 3)), np.repeat([[1, 2, 3]], 9, 0)],
    ids=["zeros", "equal", "few", "one", "repeated"],
)
def test_odd_rows_are_learned_from(X: np.ndarray) -> None:
    learner = DictionaryLearner(n_components=7, tol=0.01).fit(X)
    errors = np.linalg.norm(learner.inverse_transform(learner.transform(X)) - X, axis=1)
    assert learner.components_.shape == (7, X.shape[1]) and errors.max() <= 0.011


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"n_components": 0}, "n_components = 0"),
        ({"n_components": 2000}, "1 to 1024"),
        ({"tol": -1}, "tol = -1"),
        ({"tol": None}, "tol = none"),
        ({"pursuit": "lars"}, "pursuit = lars"),
        ({"random_state": -1}, "random_state"),
    ],
)
def test_parameters_out_of_range_are_named(options: dict[str, object], text: str) -> None:
    with pytest.raises(lx.ParameterError, match=text):
        DictionaryLearner(**options).fit(np.eye(4))  # type: ignore[arg-type]


def test_rows_that_are_not_finite_are_refused() -> None:
    with pytest.raises(ValueError):
        DictionaryLearner().fit(np.array([[1.0, np.nan]]))


#: Checks of scikit-learn that do not hold here, with the reason.
EXPECTED_FAILURES: dict[str, str] = {}


def test_scikit_learn_finds_an_estimator() -> None:
    checks = pytest.importorskip("sklearn.utils.estimator_checks")
    checks.check_estimator(DictionaryLearner(tol=0.5), expected_failed_checks=EXPECTED_FAILURES)


def test_it_works_without_scikit_learn_and_scipy() -> None:
    script = """
import sys
sys.modules["sklearn"] = sys.modules["scipy"] = sys.modules["scipy.sparse"] = None
import numpy as np, lexisplat as lx
X = np.random.default_rng(0).normal(size=(200, 6))
learner = lx.DictionaryLearner(n_components=12, tol=0.5)
codes = learner.fit_transform(X)
assert isinstance(codes, np.ndarray) and np.linalg.norm(codes @ learner.components_ - X, axis=1).max() < 0.51
assert learner.get_params()["n_components"] == 12 and "tol=0.5" in repr(learner)
assert learner.set_params(tol=0.7).tol == 0.7
for wrong in (lambda: learner.transform(X[:, :5]), lambda: learner.fit(X[0]), lambda: learner.set_params(x=1)):
    try: wrong()
    except ValueError: pass
    else: raise AssertionError
try: lx.DictionaryLearner().transform(X)
except AttributeError as error: assert "not fitted" in str(error)
"""
    subprocess.run([sys.executable, "-c", script], check=True)
