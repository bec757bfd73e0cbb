"""The fields of scenarios and airframe sheets, with units and ranges.

`groundside.scenario` reads the files, merges forms and variants, and turns the result into the specs of the processes.
"""

from ftcc.groundside.schema.aircraft import AirframeSheet, Damping, Lag, PointMassSheet, RateLimits, Start, record_of
from ftcc.groundside.schema.attacks import AttackFields
from ftcc.groundside.schema.base import Id, Strict
from ftcc.groundside.schema.network import ChannelFields, LinkEventFields
from ftcc.groundside.schema.plan import Claim, Plan, Rates, fields_of
from ftcc.groundside.schema.references import LeaderFields
from ftcc.groundside.schema.study import StudyClaim, StudyFields
from ftcc.groundside.schema.wind import TurbulenceFields
from ftcc.groundside.schema.world import FaultFields

__all__ = [
    "AirframeSheet",
    "AttackFields",
    "ChannelFields",
    "Claim",
    "Damping",
    "FaultFields",
    "Id",
    "Lag",
    "LeaderFields",
    "LinkEventFields",
    "Plan",
    "PointMassSheet",
    "RateLimits",
    "Rates",
    "Start",
    "Strict",
    "StudyClaim",
    "StudyFields",
    "TurbulenceFields",
    "fields_of",
    "record_of",
]
