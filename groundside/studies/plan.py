"""Plan a study: which values fly in which flight, and what each is asked; checked before anything starts."""

from __future__ import annotations

import functools
import itertools
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import tomli_w

from ftcc.groundside.claims import by_case
from ftcc.groundside.scenario import (
    Mission,
    Scenario,
    ScenarioError,
    find,
    load,
    read,
    resolve,
    scenario_of,
    shipped,
    validate,
    with_value,
)
from ftcc.groundside.schema import Claim, StudyFields
from ftcc.groundside.studies.errors import StudyError
from ftcc.groundside.studies.quantities import Draws, RandomQuantity, quantities_in, quantity_of

__all__ = ["CASE", "StudyPlan", "Trial", "Variation", "plan_study"]

CASE = "case"
"""Key of the variation over the scenario's cases, form and variants."""
_ATTEMPTS = 200
"""Draws after which a study with ``redraw`` gives up on a flight."""
_EDGES = (0.001, 0.999)
"""Quantiles of each random quantity that are checked before anything starts."""
_TRIED, _SHOWN = 32, 10
"""Draws among which a flight is looked for that can fly, and reasons that are shown if none can."""
_AIRFRAME = "airframe.toml"


@dataclass(frozen=True)
class Variation:
    """A key of the scenario and its values."""

    key: str
    values: tuple[Any, ...]


@dataclass(frozen=True)
class Trial:
    """One flight of a study."""

    number: int
    """Number of the flight, from 0."""
    combination: int
    """Index into the study's combinations."""
    draw: int
    """Number of the draw, from 0; all combinations fly with each."""
    seed: int


@dataclass(frozen=True)
class StudyPlan:
    """A scenario, its variations and its draws: everything that determines the flights, without a file beside it."""

    name: str
    title: str
    question: str
    form: str
    variants: tuple[str, ...]
    settings: tuple[str, ...]
    """Settings of all flights."""
    documents: tuple[tuple[str, dict[str, Any]], ...]
    """Case and merged scenario; the first is compared with the others. Without claims."""
    varied: tuple[Variation, ...]
    """Every combination of the values, in each case."""
    draws: Draws
    redraw: bool
    claims: tuple[Claim, ...]
    """What every flight is asked; ``expected`` and ``tolerance`` in the first case."""
    published: dict[str, Any] | None = None
    """The scenario's own case, for which its claims give expected values; None: no flight is of that case."""
    files: tuple[tuple[str, str], ...] = ()
    """Name and text of the files to which the documents refer."""

    @functools.cached_property
    def variations(self) -> tuple[Variation, ...]:
        """Return what differs between combinations."""
        cases = tuple(case for case, _ in self.documents)
        return ((Variation(CASE, cases),) if len(cases) > 1 else ()) + self.varied

    @functools.cached_property
    def combinations(self) -> tuple[tuple[Any, ...], ...]:
        """Return the values of `variations` in each combination."""
        return tuple(itertools.product(*(variation.values for variation in self.variations)))

    @property
    def case(self) -> str:
        """Return form and variants of the first combination."""
        return self.documents[0][0]

    @property
    def count(self) -> int:
        """Return the number of flights."""
        return self.draws.count * len(self.combinations)

    @functools.cached_property
    def flyable(self) -> tuple[int, tuple[Any, ...]]:
        """Return a combination, and values of the random quantities, that can fly: the medians, or else a draw's.

        Raises
        ------
        StudyError
            If there is none among the first draws.
        """
        problems = []
        first = range(min(self.draws.count, _TRIED) if self.draws.quantities else 0)
        for values in itertools.chain([self.draws.middle()], map(self.draws.values, first)):
            for n in range(len(self.combinations)):
                try:
                    self._resolved(n, values, self.draws.seed)
                except ScenarioError as error:
                    problems += error.problems
                else:
                    return n, values
        raise StudyError("no combination can fly:\n" + "\n".join(list(dict.fromkeys(problems))[:_SHOWN]))

    @functools.cached_property
    def mission(self) -> Mission:
        """Return the mission of `flyable`, for properties that all flights share."""
        return self._resolved(*self.flyable, self.draws.seed)

    def is_own_case(self, mission: Mission) -> bool:
        """Return whether a mission is the scenario's own case, but for its seed and duration."""
        return self._published is not None and _conditions_of(mission) == self._published

    @functools.cached_property
    def _published(self) -> tuple[Any, ...] | None:
        if self.published is None:
            return None
        form, *variants = self.case.split("+")
        file = _folder(self.files) / "study.toml"
        try:
            return _conditions_of(resolve(scenario_of(self.published, file, name=self.name, form=form, variants=variants)))
        except ScenarioError:
            return None

    def trial(self, number: int) -> Trial:
        """Return flight ``number``: all combinations of draw 0, then of draw 1, ..."""
        draw, combination = divmod(number, len(self.combinations))
        return Trial(number, combination, draw, self.draws.seed_of(draw))

    def drawn(self, trial: Trial) -> tuple[tuple[Any, ...], Mission | None, str]:
        """Return the values of the random quantities, and the mission; if it cannot fly, None and the reason.

        With ``redraw``, they are the first values with which all combinations can fly.
        """
        problem = ""
        values = self.draws.values(trial.draw)
        for attempt in range(_ATTEMPTS if self.redraw else 1):
            values = self.draws.values(trial.draw, attempt)
            try:
                mission = self._resolved(trial.combination, values, trial.seed)
                if self.redraw:
                    for n in range(len(self.combinations)):
                        self._resolved(n, values, trial.seed)
                return values, mission, ""
            except ScenarioError as error:
                problem = "; ".join(error.problems)
        return values, None, problem

    def settings_of(self, trial: Trial, values: Sequence[Any]) -> dict[str, Any]:
        """Return all values, by key, that distinguish a flight from the scenario."""
        chosen = zip(self.variations, self.combinations[trial.combination], strict=True)
        found = {variation.key: value for variation, value in chosen if variation.key != CASE}
        found |= {one.key: value for one, value in zip(self.draws.quantities, values, strict=True)}
        return found | {"seed": trial.seed}

    def scenario(
        self, combination: int, values: Sequence[Any], seed: int, claims: Sequence[dict[str, Any]] = ()
    ) -> Scenario:
        """Return the scenario of a combination with these values of the random quantities.

        Raises
        ------
        ScenarioError
        """
        case = self.case_of(combination)
        document = dict(self.documents)[case]
        form, *variants = case.split("+")
        for key, value in self._changes(combination, values):
            try:
                document = with_value(document, key.split("."), value)
            except LookupError as error:
                raise ScenarioError(self.name, [f"{key}: {error.args[0]}"]) from None
        document = {**document, "seed": seed, "claims": list(claims)}
        file = _folder(self.files) / "study.toml"
        return scenario_of(document, file, name=self.name, form=form, variants=variants)

    def case_of(self, combination: int) -> str:
        """Return form and variants of a combination."""
        return self.combinations[combination][0] if len(self.documents) > 1 else self.case

    def _changes(self, combination: int, values: Sequence[Any]) -> Iterable[tuple[str, Any]]:
        chosen = zip(self.variations, self.combinations[combination], strict=True)
        yield from ((variation.key, value) for variation, value in chosen if variation.key != CASE)
        yield from ((one.key, value) for one, value in zip(self.draws.quantities, values, strict=True))

    def _resolved(self, combination: int, values: Sequence[Any], seed: int) -> Mission:
        return resolve(self.scenario(combination, values, seed))


@functools.lru_cache(maxsize=4)
def _folder(files: tuple[tuple[str, str], ...]) -> Path:
    """Return a folder that holds these files until this process ends."""
    import atexit
    import shutil
    import tempfile

    if not files:
        return Path()
    folder = Path(tempfile.mkdtemp(prefix="ftcc-study-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    for name, text in files:
        (folder / name).write_text(text, encoding="utf-8")
    return folder


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
    variants: Sequence[str] = (),
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
            update={"vary": {}, "random": {}, "against": [], "claims": [], "changes": {}, "samples": None, "question": ""}
        )
    quantities = _quantities(random, fields)
    variations = _variations(vary, fields)
    _refuse_doubles(variations, quantities)
    first, documents = _cases(
        scenario,
        fields,
        against or fields.against,
        form=form or fields.form,
        variants=variants or fields.variants,
        settings=settings,
        seed=seed if seed is not None else fields.seed,
        duration=duration,
    )
    draws = Draws(
        quantities,
        design or fields.design,
        samples or seeds or fields.samples or 1,
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
            instead = "use --samples and --seed" if key == "seed" else "use --against"
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


def _conditions_of(mission: Mission) -> tuple[Any, ...]:
    """Return everything that determines a flight, except its duration and seed."""
    timing = mission.timing._replace(ticks=0, seed=0)
    vehicles = tuple(
        replace(spec, gust=spec.gust._replace(seed=0), turbulence=spec.turbulence._replace(seed=0))
        for spec in mission.vehicles
    )
    return mission.scheme.name, mission.wire, timing, mission.graph.weights, vehicles, mission.autopilots


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


def as_toml(value: Any) -> str:
    """Return a value as it stands in a TOML file."""
    return tomli_w.dumps({"value": value}).partition("=")[2].strip()
