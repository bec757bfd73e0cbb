"""The compiled tick of a scheme, made from the templates `stages` and `flight`; plain Python where numba refuses it."""

from __future__ import annotations

import functools
from types import ModuleType

from ftcc.airside.autopilots import build
from ftcc.airside.diagnosis import active as active_tolerance
from ftcc.airside.diagnosis import passive as passive_tolerance
from ftcc.airside.diagnosis.gains import DiagnosisGains
from ftcc.airside.law_errors import describe_left_out, package_of
from ftcc.airside.model import Model
from ftcc.airside.references import of_plant
from ftcc.airside.schemes import find
from ftcc.airside.spec import AutopilotSpec, DiagnosisSpec, OwnReference
from ftcc.link.actuators import ACTUATORS
from ftcc.link.channel import Channel
from ftcc.link.compiled import instantiate, refusal, uncompile
from ftcc.link.timing import Timing

__all__ = ["flight_of", "placeholder", "stages_of"]


@functools.cache
def stages_of(name: str, active: bool = False) -> ModuleType:
    """The stages of a tick under a scheme, by its name, with active fault tolerance or without, see `stages`.

    They are compiled, or, where the scheme is not or numba cannot compile it, plain Python: then their ``REFUSAL`` says
    why.
    """
    scheme = find(name)
    stages = instantiate(
        "ftcc.airside.stages",
        _instance(name, active),
        scheme=scheme.module,
        references=of_plant(scheme.plant),
        tolerance=active_tolerance if active else passive_tolerance,
    )
    autopilots, inbox = build([placeholder(name, active)], Timing(1, 1, 1, 1, 1, 1, 1))
    because = describe_left_out(scheme.module)
    if not because and (refused := refusal(stages.control, autopilots, inbox, 0, 0.01)):
        because = f"numba cannot compile it ({refused})"
    if because:
        stages.__dict__["REFUSAL"] = f"scheme {name} flies as plain Python, slowly: {because}"
        uncompile([stages, *package_of(scheme.module)])
    return stages


@functools.cache
def flight_of(name: str, active: bool = False) -> ModuleType:
    """The flight of autopilots under a scheme, by its name, see `flight`: compiled or not, as its stages are."""
    stages = stages_of(name, active)
    flight = instantiate("ftcc.airside.flight", _instance(name, active), stages=stages)
    if stages.REFUSAL:
        uncompile([flight])
    return flight


def _instance(name: str, active: bool) -> str:
    return f"{name},active" if active else name


def placeholder(name: str, active: bool = False) -> AutopilotSpec:
    """A follower that knows and hears nothing, to compile with."""
    scheme = find(name)
    return AutopilotSpec(
        uav=1,
        role="follower",
        scheme=name,
        gains=(0.0,) * len(scheme.gains_type._fields),
        model=Model(*(0.0,) * len(Model._fields)),
        command=(0.0,) * len(ACTUATORS),
        travel=(0.0,) * len(ACTUATORS),
        reference=OwnReference((0.0,) * len(of_plant(scheme.plant).Reference._fields)),
        neighbours=(),
        channel=Channel(),
        diagnosis=DiagnosisSpec(on=active, gains=(0.0,) * len(DiagnosisGains._fields)),
    )
