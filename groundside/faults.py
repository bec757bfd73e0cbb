"""What the faults of a scenario do to its vehicles."""

from __future__ import annotations

from ftcc.groundside.schema import FaultFields, Plan
from ftcc.link.actuators import SLOT, unit_of
from ftcc.sim import navigation
from ftcc.sim.navigation import NavigationFault
from ftcc.sim.plant import INTERMITTENT, STUCK, WRONG, Fault

__all__ = ["actuator_faults", "fault_text", "navigation_faults"]

_KINDS = {"stuck": STUCK, "intermittent": INTERMITTENT}
_PARTS = {"position": navigation.POSITION, "attitude": navigation.ATTITUDE}
_NAVIGATION_KINDS = {
    "wrong": navigation.WRONG,
    "off": navigation.OFF,
    "stuck": navigation.STUCK,
    "slow": navigation.SLOW,
    "intermittent": navigation.INTERMITTENT,
    "ok": navigation.WRONG,
}


def actuator_faults(plan: Plan, uav: int) -> tuple[Fault, ...]:
    """The faults of a UAV's actuators, in order of time."""
    return tuple(
        Fault(
            f.at,
            float(SLOT[f.actuator]),
            0.0 if f.kind == "off" else f.effectiveness,
            f.bias,
            f.effectiveness_onset,
            f.bias_onset,
            float(_KINDS.get(f.kind, WRONG)),
            **{name: getattr(f, name) for name in ("slew", "period", "duty") if getattr(f, name) is not None},
        )
        for f in sorted(plan.faults, key=lambda f: f.at)
        if f.uav == uav and f.actuator is not None
    )


def navigation_faults(plan: Plan, uav: int) -> tuple[NavigationFault, ...]:
    """The faults of a UAV's navigation solution, in order of time."""
    return tuple(
        NavigationFault(
            f.at,
            float(_PARTS[f.navigation]),
            float(_NAVIGATION_KINDS[f.kind]),
            1.0 if f.period is None else f.period,
            1.0 if f.duty is None else f.duty,
            *f.offset,
            *f.rate_offset,
        )
        for f in sorted(plan.faults, key=lambda f: f.at)
        if f.uav == uav and f.navigation is not None
    )


def fault_text(fault: FaultFields) -> str:
    """A fault in words, for the log."""
    what = fault.actuator.replace("_", " ") if fault.actuator else f"navigation ({fault.navigation})"
    if fault.kind == "ok" or (fault.kind == "wrong" and fault.actuator and (fault.effectiveness, fault.bias) == (1, 0)):
        return f"{what} repaired"
    if fault.actuator is not None and fault.kind in ("wrong", "intermittent"):
        unit = f" {unit_of(fault.actuator)}".removesuffix(" -")
        how = "" if fault.kind == "wrong" else "intermittent "
        return f"{what} {how}fault: effectiveness {fault.effectiveness:.4g}, bias {fault.bias:.4g}{unit}"
    return f"{what} {fault.kind}"
