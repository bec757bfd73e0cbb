"""Plan a study from a scenario, its ``[study]`` and options; everything is checked before anything starts."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from ftcc.groundside.claims import by_case
from ftcc.groundside.scenario import (
    Scenario,
    ScenarioError,
    find,
    load,
    read,
    resolve,
    shipped,
    validate,
    variant_names,
)
from ftcc.groundside.schema import Claim, StudyFields
from ftcc.groundside.studies.errors import StudyError
from ftcc.groundside.studies.plan import CASE, StudyPlan, Variation
from ftcc.groundside.studies.quantities import Draws, RandomQuantity, quantities_in, quantity_of

__all__ = ["plan_of_fields", "plan_study"]

_EDGES = (0.001, 0.999)
"""Quantiles of each random quantity that are checked before anything starts."""
_AIRFRAME = "airframe.toml"


def plan_study(
    name: str | Path,
    vary: Sequence[str] | Mapping[str, Sequence[Any]] = (),
    *,
    random: Sequence[str] | Mapping[str, Any] = (),
    samples: int | None = None,
    seeds: int | None = None,
    design: str | None = None,
    redraw: bool | None = None,
    against: Sequence[str] = (),
    sensitivity: bool = False,
    form: str | None = None,
    variants: str | Sequence[str] = (),
    settings: Sequence[str] = (),
    seed: int | None = None,
    duration: float | None = None,
) -> StudyPlan:
    """Plan a study.

    Parameters
    ----------
    name : str
        A scenario, see `scenario.load`, as are ``form``, ``variants``, ``settings`` and ``duration``; or a file with a
        ``[study]`` table that names one. ``vary``, ``random``, ``against`` or ``seeds`` replace that table, the others
        refine it.
    vary : sequence of str, or mapping
        ``key.path=value,value,...`` with values as in TOML, or lists by key; the study flies every combination.
    random : sequence of str, or mapping
        ``key.path=distribution(...)``, or tables as in ``[study.random]``.
    samples, seeds : int, optional
        Number of draws; each has a seed of its own, consecutive from ``seed``.
    design : str, optional
        "sobol" (default), "lhs" or "random", see `statistics.Design`.
    redraw : bool, optional
        Whether a draw that cannot fly is drawn again; default: it is a row with the reason.
    against : sequence of str
        Variants, several joined by "+", with which every draw flies too.
    sensitivity : bool
        Draw for Sobol' indices; ``samples`` is the number of base samples.
    seed : int, optional
        Of the draws, and of the first flight; default: that of the scenario.

    Raises
    ------
    StudyError
        For an invalid study, or if no combination can fly.
    ScenarioError
        If the unchanged scenario cannot fly, or a value is invalid in the format of scenarios.
    """
    if samples is not None and seeds is not None:
        raise StudyError("--samples and --seeds: give one; every draw has a seed of its own")
    for option, number in (("--samples", samples), ("--seeds", seeds)):
        if number is not None and number < 1:
            raise StudyError(f"{option} {number}: must be at least 1")
    scenario, fields = _declared(name)
    if vary or random or against or seeds is not None:
        fields = fields.model_copy(
            update={
                "vary": {},
                "random": {},
                "against": [],
                "claims": [],
                "changes": {},
                "samples": None,
                "question": "",
            }
        )
    return plan_of_fields(
        scenario,
        fields,
        variations=_variations(vary, fields),
        quantities=_quantities(random, fields),
        samples=samples or seeds,
        design=design,
        redraw=redraw,
        against=against,
        sensitivity=sensitivity,
        form=form,
        variants=variants,
        settings=settings,
        seed=seed,
        duration=duration,
    )


def plan_of_fields(
    scenario: str | Path,
    fields: StudyFields,
    *,
    variations: tuple[Variation, ...] | None = None,
    quantities: tuple[RandomQuantity, ...] | None = None,
    samples: int | None = None,
    design: str | None = None,
    redraw: bool | None = None,
    against: Sequence[str] = (),
    sensitivity: bool = False,
    form: str | None = None,
    variants: str | Sequence[str] = (),
    settings: Sequence[str] = (),
    seed: int | None = None,
    duration: float | None = None,
) -> StudyPlan:
    """Plan the study of a scenario that ``fields`` describe; what else is given stands above them, see `plan_study`.

    Raises
    ------
    StudyError, ScenarioError
    """
    quantities = _quantities((), fields) if quantities is None else quantities
    variations = _variations((), fields) if variations is None else variations
    _refuse_doubles(variations, quantities)
    first, documents = _cases(
        scenario,
        fields,
        against or fields.against,
        form=form or fields.form,
        variants=variant_names(variants) or fields.variants,
        settings=settings,
        seed=seed if seed is not None else fields.seed,
        duration=duration,
    )
    draws = Draws(
        quantities,
        design or fields.design,
        samples or fields.samples or 1,
        first.plan.seed,
        sensitivity,
    )
    if sensitivity and not quantities:
        raise StudyError("--sensitivity: needs random quantities; declare them in [study.random], or give --random")
    files, documents = _with_files(first, documents)
    plan = StudyPlan(
        name=first.name,
        title=first.plan.title,
        question=fields.question,
        form=first.form,
        variants=first.variants,
        settings=first.settings,
        documents=documents,
        varied=variations,
        draws=draws,
        redraw=fields.redraw if redraw is None else redraw,
        claims=_claims(first, fields),
        published=None if quantities else _published(scenario, first),
        files=files,
    )
    _check_values(plan)
    return plan


def _declared(name: str | Path) -> tuple[str | Path, StudyFields]:
    """Return the scenario of a study, and what its ``[study]`` says."""
    path = Path(name)
    if str(name) not in shipped() and path.is_file() and path.suffix == ".toml":
        try:
            document = tomllib.loads(path.read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
            raise ScenarioError(path, [f"not a TOML file: {error}"]) from None
        table = document.get("study")
        if isinstance(table, Mapping) and "of" in table:
            if strangers := [key for key in document if key != "study"]:
                raise ScenarioError(
                    path, [f"{strangers[0]}: a study of another scenario holds [study] alone; see [study.changes]"]
                )
            fields = validate(StudyFields, dict(table), path)
            of = str(fields.of)
            return (of if of in shipped() else path.parent / of), fields
    file = find(name)
    table = read(file).get("study", {})
    fields = validate(StudyFields, table, file) if "flown" not in read(file) else StudyFields()
    if fields.of is not None:
        raise ScenarioError(file, ["study.of: stands in a file that holds nothing but [study]"])
    return name, fields


def _quantities(random: Sequence[str] | Mapping[str, Any], fields: StudyFields) -> tuple[RandomQuantity, ...]:
    if isinstance(random, Mapping):
        tables = {key: value for key, value in random.items() if not isinstance(value, str)}
        texts = [f"{key}={value}" for key, value in random.items() if isinstance(value, str)]
    else:
        tables, texts = {}, list(random)
    if not random:
        tables = fields.random
    return (*quantities_in(tables), *(quantity_of(text) for text in texts))


def _variations(vary: Sequence[str] | Mapping[str, Sequence[Any]], fields: StudyFields) -> tuple[Variation, ...]:
    given = vary or fields.vary
    if not isinstance(given, Mapping):
        return tuple(_variation(text) for text in given)
    found = []
    for key, values in given.items():
        if not isinstance(values, (list, tuple)) or not values:
            raise StudyError(f"vary.{key} = {values!r}: must be a list of values")
        found.append(_distinct(Variation(key, tuple(values)), f"vary.{key}"))
    return tuple(found)


def _refuse_doubles(variations: Sequence[Variation], quantities: Sequence[RandomQuantity]) -> None:
    keys = [*(variation.key for variation in variations), *(one.key for one in quantities)]
    for key in keys:
        if keys.count(key) > 1:
            raise StudyError(f"--vary {key}: given twice; give all values in one --vary, or a distribution")
        if key in ("seed", CASE):
            instead = "use --seeds and --seed" if key == "seed" else "use --against"
            raise StudyError(f"--vary {key}: every combination flies with every seed; {instead}")


def _cases(
    scenario: str | Path, fields: StudyFields, against: Sequence[str], *, variants: Sequence[str], **options: Any
) -> tuple[Scenario, tuple[tuple[str, dict[str, Any]], ...]]:
    """Return the scenario of the first case, and the merged document of each."""
    loaded = [
        load(scenario, variants=chosen, changes=fields.changes, **options)
        for chosen in (variants, *([*variants, *other.split("+")] for other in against))
    ]
    names = [one.case for one in loaded]
    for name in names:
        if names.count(name) > 1:
            raise StudyError(f"--against: case {name} is there already; give variants that change something")
    return loaded[0], tuple((one.case, _flown_part(one.document)) for one in loaded)


def _published(scenario: str | Path, first: Scenario) -> dict[str, Any] | None:
    """Return the scenario's own case, without what the study and the command line change."""
    if first.plan.flown is not None:
        return None if first.plan.flown.settings else _flown_part(first.document)
    return _flown_part(load(scenario, form=first.form, variants=first.variants).document)


def _flown_part(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return what flies of a merged document: no claims, no study."""
    others = ("claims", "study", "flown", "form", "variant")
    return {key: value for key, value in document.items() if key not in others}


def _with_files(
    first: Scenario, documents: tuple[tuple[str, dict[str, Any]], ...]
) -> tuple[tuple[tuple[str, str], ...], tuple[tuple[str, dict[str, Any]], ...]]:
    """Return the airframe's sheet if it is a file of the user's, and the documents that refer to it."""
    sheet = first.file.parent / first.plan.airframe
    if first.plan.airframe in shipped("airframes") or not sheet.is_file():
        return (), documents
    text = sheet.read_text(encoding="utf-8")
    return ((_AIRFRAME, text),), tuple((case, {**one, "airframe": _AIRFRAME}) for case, one in documents)


def _claims(first: Scenario, fields: StudyFields) -> tuple[Claim, ...]:
    """Return the claims of the study, or else of the scenario's case; each for the first case alone."""
    case = first.case
    if not fields.claims:
        return tuple(
            claim.model_copy(
                update={
                    "expected": {case: claim.expected[case]},
                    "tolerance": by_case(claim.tolerance, case),
                    "threshold": by_case(claim.threshold, case),
                }
            )
            for claim in first.plan.claims
            if case in claim.expected
        )
    return tuple(
        Claim(
            **one.model_dump(exclude={"bound"}),
            source="bound of the study",
            expected={case: 0.0},
            tolerance=one.bound,
        )
        for one in fields.claims
    )


def _check_values(plan: StudyPlan) -> None:
    """Refuse keys and values that the format of scenarios does not allow, and claims about what is not recorded.

    Raises
    ------
    StudyError, ScenarioError
    """
    middle, seed = plan.draws.middle(), plan.draws.seed
    for case in range(len(plan.documents)):
        plan.scenario(case * (len(plan.combinations) // len(plan.documents)), middle, seed)
    for values in _one_by_one(plan.varied):
        plan.scenario(plan.combinations.index((plan.case, *values)[len(plan.documents) == 1 :]), middle, seed)
    for place in range(len(middle)):
        for edge in _EDGES:
            shares = [0.5] * len(middle)
            shares[place] = edge
            plan.scenario(0, plan.draws.at(shares), seed)
    claims = [claim.model_dump(by_alias=True, exclude_none=True) for claim in plan.claims]
    resolve(plan.scenario(*plan.flyable, seed, claims))


def _one_by_one(variations: Sequence[Variation]) -> Iterator[tuple[Any, ...]]:
    """Yield combinations in which at most one variation has another value than its first one."""
    for n, variation in enumerate(variations):
        for value in variation.values:
            yield tuple(value if place == n else other.values[0] for place, other in enumerate(variations))


def _variation(text: str) -> Variation:
    key, equals, given = text.partition("=")
    key = key.strip()
    if not equals or not key or not given.strip():
        raise StudyError(f"--vary {text}: must be key.path=value,value,..., such as channel.loss=0,0.1,0.3")
    try:
        values = tomllib.loads(f"values = [{given}]")["values"]
    except tomllib.TOMLDecodeError:
        values = [_number_or_text(part.strip()) for part in given.split(",")]
    if "" in values:
        raise StudyError(f"--vary {text}: a value is missing between two commas")
    return _distinct(Variation(key, tuple(values)), f"--vary {text}")


def _distinct(variation: Variation, where: str) -> Variation:
    if any(variation.values.count(value) > 1 for value in variation.values):
        raise StudyError(f"{where}: a value is listed twice")
    return variation


def _number_or_text(text: str) -> float | str:
    """Read a value that TOML refuses: a number such as .1, or a word without quotes."""
    try:
        return float(text)
    except ValueError:
        return text
