"""From the output channels of an autopilot to the actuators of the plant, as a table that is checked."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.link.actuators import AILERON, ELEVATOR, RUDDER, THRUST

__all__ = ["ARDUPILOT", "PX4", "PX4_TABLES", "ChannelError", "Channels", "by_pwm", "checked", "fractions"]


class ChannelError(ValueError):
    """A table of channels cannot be used."""


class Channels(NamedTuple):
    """For each actuator the channels that move it, each with the share of its signal: (number from 0, share).

    Our positive deflections turn about their axes negatively (right aileron down, elevator down, rudder left), those of
    PX4 and ArduPilot positively: hence the signs.
    """

    aileron: tuple[tuple[int, float], ...]
    elevator: tuple[tuple[int, float], ...]
    rudder: tuple[tuple[int, float], ...]
    throttle: int


PX4 = Channels(aileron=((5, 0.5), (6, -0.5)), elevator=((7, -1.0),), rudder=((2, -1.0),), throttle=4)
"""PX4's fixed wing: 2 rudder, 3 flaps, 4 throttle, 5 left and 6 right aileron, 7 elevator, 8 flaps.

That is the order of mixer plane_sitl (2021), and of PWM_MAIN_FUNC3 to 9 in airframe 1036_jsbsim_malolo since.
"""

PX4_TABLES = {"ftcc_plane": PX4, "plane": PX4, "jsbsim_malolo": PX4}
"""By the model, that is the name of PX4's airframe; `PX4` for others."""

ARDUPILOT = Channels(aileron=((0, -1.0),), elevator=((1, -1.0),), rudder=((3, -1.0),), throttle=2)
"""ArduPlane's default SERVO1 to 4: aileron, elevator, throttle, rudder."""


def checked(table: Channels, channels: int) -> Channels:
    """Return the table, if an autopilot with that many channels can use it.

    Raises
    ------
    ChannelError
        If a channel does not exist or has two tasks, a surface has none, or its shares are not 1 together.
    """
    used = [table.throttle]
    for name in ("aileron", "elevator", "rudder"):
        shares = getattr(table, name)
        if not math.isclose(sum(abs(share) for _, share in shares), 1.0):
            raise ChannelError(f"channels of {name}: the shares of {shares} must be 1 together")
        used += [channel for channel, _ in shares]
    if len(set(used)) < len(used):
        raise ChannelError(f"channels {sorted(used)}: one has two tasks")
    if not all(0 <= channel < channels for channel in used):
        raise ChannelError(f"channels {sorted(used)}: must be from 0 to {channels - 1}")
    return table


def fractions(table: Channels, signals: Sequence[float], out: NDArray[np.float64]) -> None:
    """Write the signals, -1..1 and 0..1 for the throttle, as fractions of travel into ``out`` (4,).

    An actuator whose signal is not finite keeps what it had. Signals beyond their range are limited.
    """
    for slot, shares in ((AILERON, table.aileron), (ELEVATOR, table.elevator), (RUDDER, table.rudder)):
        value = sum(share * signals[channel] for channel, share in shares)
        if math.isfinite(value):
            out[slot] = min(max(value, -1.0), 1.0)
    if math.isfinite(signals[table.throttle]):
        out[THRUST] = min(max(signals[table.throttle], 0.0), 1.0)


def by_pwm(table: Channels, pwm: Sequence[int], out: NDArray[np.float64]) -> None:
    """Write pulses (us, 1000..2000) as fractions of travel into ``out`` (4,); a channel without pulses is at rest."""
    signals = [(pulse - 1500) / 500 if pulse else 0.0 for pulse in pwm]
    pulse = pwm[table.throttle]
    signals[table.throttle] = (pulse - 1000) / 1000 if pulse else 0.0
    fractions(table, signals, out)
