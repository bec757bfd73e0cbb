"""Flies the cases of a scenario in memory and evaluates their claims."""

from __future__ import annotations

from ftcc.groundside.claims import Result
from ftcc.groundside.scenario import Scenario, Settings, forms_and_variants, load, resolve
from ftcc.groundside.simulation.flight import Flight
from ftcc.groundside.simulation.one_process import fly_in_memory

__all__ = ["cases_of", "claims_in_flight", "load_case"]


def cases_of(scenario: Scenario) -> list[str]:
    """Return the cases of a scenario: each form, and every other case that a claim names."""
    forms, _ = forms_and_variants(scenario.source)
    return list(dict.fromkeys([*forms, *(case for claim in scenario.plan.claims for case in claim.expected)]))


def load_case(name: str, case: str, settings: Settings = (), **options: float | None) -> Scenario:
    """Load a scenario in a case such as ``flight+P+off``; ``options`` are seed and duration, see `scenario.load`."""
    form, *variants = case.split("+")
    return load(name, form=form, variants=variants, settings=settings, **options)  # type: ignore[arg-type]


def claims_in_flight(scenario: Scenario) -> tuple[Flight, list[Result]]:
    """Fly a scenario in memory; return the flight and the results of its case's claims."""
    flight = fly_in_memory(resolve(scenario))
    return flight, flight.claims()
