"""What a search flies next: generations of points that Optuna asks for."""

from __future__ import annotations

import importlib.util
import warnings
from collections.abc import Sequence
from typing import Any

from ftcc.groundside.statistics import Design
from ftcc.groundside.studies.errors import StudyError

__all__ = ["GENERATION", "Sampler", "optuna_for"]

GENERATION = 12
"""Flights that are asked for together, whatever the number of workers."""
_SIGMA = 0.25
"""Standard deviation of the first flights of CMA-ES, in the unit cube."""


def _installed(name: str) -> bool:
    try:
        return importlib.util.find_spec(name) is not None
    except ValueError:  # a module without a specification, or one that was put out of reach
        return False


def optuna_for(method: str) -> Any:
    """Return Optuna.

    Raises
    ------
    StudyError
        If it, or CMA-ES, is not installed.
    """
    missing = [name for name in ("optuna", *(("cmaes",) if method == "cmaes" else ())) if not _installed(name)]
    if missing:
        needs = " and ".join(missing)
        raise StudyError(f'ftcc search: needs {needs}; install it with: pip install "ftcc-sitl[search]"')
    import optuna

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    return optuna


class Sampler:
    """Asks for generations of points in the unit cube, and is told their objectives in the same order.

    The first generation fills the cube evenly; from the best of it, or from the scenario's own values, Optuna goes on.
    """

    def __init__(self, method: str, own: Sequence[float], seed: int, objective: float) -> None:
        """Begin with the objective of the scenario's own values."""
        self._optuna = optuna_for(method)
        self._method = method
        self._seed = seed % 2**32
        self._design = Design("sobol", len(own), self._seed, GENERATION)
        self._keys = [f"{n}" for n in range(len(own))]
        self._space = {key: self._optuna.distributions.FloatDistribution(0.0, 1.0) for key in self._keys}
        self._first = [(objective, tuple(own))]
        self._asked: list[tuple[float, ...]] = []
        self._study: Any = None
        self._trials: list[Any] = []

    def ask(self, count: int) -> list[tuple[float, ...]]:
        """Return the points of the next flights."""
        if self._study is None:
            self._asked = [tuple(point) for point in self._design.points(0, count).tolist()]
            return self._asked
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            self._trials = [self._study.ask(self._space) for _ in range(count)]
        return [tuple(trial.params[key] for key in self._keys) for trial in self._trials]

    def tell(self, objectives: Sequence[float]) -> None:
        """Take note of the objectives of the flights that were asked for last."""
        if self._study is None:
            self._first += zip(objectives, self._asked, strict=True)
            self._begin()
            return
        for trial, objective in zip(self._trials, objectives, strict=True):
            self._study.tell(trial, objective)

    def _begin(self) -> None:
        samplers = self._optuna.samplers
        best = dict(zip(self._keys, min(self._first)[1], strict=True))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that a feature is experimental: the tests hold it to its results
            if self._method == "cmaes":
                sampler = samplers.CmaEsSampler(x0=best, sigma0=_SIGMA, popsize=GENERATION, seed=self._seed)
            else:
                sampler = samplers.TPESampler(seed=self._seed, multivariate=True, n_startup_trials=1)
            self._study = self._optuna.create_study(sampler=sampler)
        for objective, point in self._first:
            params = dict(zip(self._keys, point, strict=True))
            trial = self._optuna.trial.create_trial(params=params, distributions=self._space, value=objective)
            self._study.add_trial(trial)
