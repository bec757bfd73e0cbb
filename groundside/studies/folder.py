"""The folder of a study: its plan as ``study.toml``, from which it goes on and each flight can be repeated."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import tomli_w

from ftcc.groundside.schema import Claim
from ftcc.groundside.statistics import distribution_of
from ftcc.groundside.studies.errors import StudyError
from ftcc.groundside.studies.plan import StudyPlan, Variation
from ftcc.groundside.studies.quantities import Draws, RandomQuantity
from ftcc.groundside.studies.versions import difference, versions

__all__ = ["PLAN_FILE", "check_same", "is_study", "load_plan", "refuse_another", "save_plan"]

PLAN_FILE = "study.toml"
_FORMAT = 1
_OF_ONE_RUN = ("samples",)
"""What may differ where a study goes on: it may become larger."""


def is_study(path: str | Path) -> bool:
    """Return whether a folder holds a study."""
    return (Path(path) / PLAN_FILE).is_file()


def save_plan(plan: StudyPlan, folder: Path) -> Path:
    """Write ``study.toml``."""
    path = folder / PLAN_FILE
    unfinished = path.with_suffix(".unfinished")
    unfinished.write_text(tomli_w.dumps(_document(plan)), encoding="utf-8")
    unfinished.replace(path)
    return path


def load_plan(folder: str | Path, same_version: bool = True) -> StudyPlan:
    """Read ``study.toml``.

    Raises
    ------
    StudyError
        If the folder holds no study, or one of another version of the program and ``same_version``.
    """
    path = Path(folder) / PLAN_FILE
    if not path.is_file():
        raise StudyError(f"{folder}: is no study: it has no {PLAN_FILE}")
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
        plan = _plan(document)
    except (KeyError, TypeError, ValueError) as error:
        raise StudyError(f"{path}: damaged, or of another version of the program: {error!r}") from None
    if same_version and (wrong := difference(document["versions"])):
        raise StudyError(
            f"{path}: was begun by another version of the program ({wrong}); it can only go on with that one"
        )
    return plan


def check_same(plan: StudyPlan, folder: Path) -> None:
    """Refuse to go on with ``plan`` in the folder of another study.

    Raises
    ------
    StudyError
    """
    there, here = (tomllib.loads(tomli_w.dumps(_document(one))) for one in (load_plan(folder), plan))
    refuse_another("study", folder, here, there)


def refuse_another(kind: str, folder: Path, here: dict[str, Any], there: dict[str, Any]) -> None:
    """Refuse to go on in a folder whose document says something else.

    Raises
    ------
    StudyError
    """
    if differing := [key for key in here if key not in _OF_ONE_RUN and here[key] != there.get(key)]:
        what = ", ".join(differing)
        raise StudyError(f"{folder}: holds another {kind}: {what} differ; give another folder with --out")


def _document(plan: StudyPlan) -> dict[str, Any]:
    draws = plan.draws
    document: dict[str, Any] = {
        "format": _FORMAT,
        "name": plan.name,
        "title": plan.title,
        "question": plan.question,
        "form": plan.form,
        "variants": list(plan.variants),
        "settings": list(plan.settings),
        "design": draws.design,
        "samples": draws.samples,
        "seed": draws.seed,
        "sensitivity": draws.sensitivity,
        "redraw": plan.redraw,
        "versions": versions(),
        "vary": [{"key": one.key, "values": list(one.values)} for one in plan.varied],
        "random": [
            {"key": one.key, "distribution": one.distribution.name, **one.distribution.parameters}
            for one in draws.quantities
        ],
        "claims": [claim.model_dump(by_alias=True, exclude_none=True) for claim in plan.claims],
        "files": dict(plan.files),
        "case": [{"name": case, "scenario": scenario} for case, scenario in plan.documents],
    }
    return document if plan.published is None else document | {"published": plan.published}


def _plan(document: dict[str, Any]) -> StudyPlan:
    if document["format"] != _FORMAT:
        raise ValueError(f"format {document['format']} is not {_FORMAT}")
    random = tuple(
        RandomQuantity(table.pop("key"), distribution_of(table, "random")) for table in map(dict, document["random"])
    )
    draws = Draws(random, document["design"], document["samples"], document["seed"], document["sensitivity"])
    return StudyPlan(
        name=document["name"],
        title=document["title"],
        question=document["question"],
        form=document["form"],
        variants=tuple(document["variants"]),
        settings=tuple(document["settings"]),
        documents=tuple((case["name"], case["scenario"]) for case in document["case"]),
        varied=tuple(Variation(one["key"], tuple(one["values"])) for one in document["vary"]),
        draws=draws,
        redraw=document["redraw"],
        claims=tuple(Claim.model_validate(claim) for claim in document["claims"]),
        published=document.get("published"),
        files=tuple(document["files"].items()),
    )
