"""The commands to a running swarm: faults, links, parameters, leaders, the flow of time; keys of signed links."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ftcc.groundside.cli.common import fail, terminal, warn
from ftcc.link.text import as_seconds

if TYPE_CHECKING:
    from ftcc.groundside.swarm import Control, Station

__all__ = [
    "attitude",
    "commands",
    "fault",
    "ftc",
    "keys",
    "leader",
    "link",
    "mode",
    "param",
    "pause",
    "repair",
    "resume",
    "speed",
    "step",
    "vehicles",
]

_REFUSED = 1
_SNAPSHOT_TIMEOUT = 2.0
"""Longest wait for what the swarm's station knows, wall s."""

Swarm = Annotated[
    str | None, typer.Option("--swarm", help="Name of the swarm, see `ftcc ps`; needed if several are running.")
]
Key = Annotated[Path | None, typer.Option("--key", help="Key file for signed links; default: the key of the swarm.")]
Uav = Annotated[int, typer.Argument(metavar="UAV", help="Id of the UAV.")]
Other = Annotated[
    int | None, typer.Argument(metavar="[UAV]", help="The other end of the link; default: all links of the UAV.")
]
At = Annotated[float | None, typer.Option(help="Simulated time at which it takes effect, s; default: at once.")]

link = typer.Typer(name="link", no_args_is_help=True, help="Cut, degrade and restore radio links.")
param = typer.Typer(
    name="param", no_args_is_help=True, help="Read and set parameters: gains, channel, failure sizes, rates."
)
keys = typer.Typer(name="keys", no_args_is_help=True, help="Make keys: signed links to the ground, encrypted mesh.")


@contextmanager
def _station(swarm: str | None, key: Path | None) -> Iterator[Station]:
    """A station; a refusal ends with exit code 1, a vehicle that is not there with 2."""
    from ftcc.groundside.swarm import RefusedError, Station

    with Station(swarm, key=key) as station:
        try:
            yield station
        except RefusedError as error:
            terminal(stderr=True).print(f"ftcc: {error}", style="bold red", markup=False, highlight=False)
            raise typer.Exit(_REFUSED) from None


def _say(text: str) -> None:
    terminal().print(text, markup=False, highlight=False, soft_wrap=True)


def _faults_and_beliefs(name: str) -> tuple[dict[int, tuple[str, str]], dict[int, str]]:
    """Of each UAV that diagnoses its actuators the faults that it has, and those that it believes to have; and of each
    UAV, whom it distrusts, where anybody does."""
    from ftcc.groundside.dashboard import describe_beliefs, describe_distrust, describe_faults, watch_swarm

    try:
        snapshot = next(watch_swarm(name, _SNAPSHOT_TIMEOUT), None)
    except OSError:
        # The swarm's station is busy or has ended: the UAVs answer for themselves.
        return {}, {}
    uavs = snapshot.uavs if snapshot else {}
    words = {}
    for uav, state in uavs.items():
        if believed := describe_beliefs(state, state.effectiveness):
            words[uav] = (describe_faults(state) or "healthy", believed)
    doubts = {uav: describe_distrust(state).removeprefix("distrusts ") for uav, state in uavs.items()}
    return words, doubts if any(doubts.values()) else {}


def vehicles(swarm: Swarm = None, key: Key = None) -> None:
    """List the UAVs of a running swarm, with the UDP port and the present state of each.

    Where they diagnose their actuators, also what faults each believes to have, beside those that it has; where one
    distrusts another, whom.
    """
    from rich.table import Table

    from ftcc.groundside.swarm import NoAnswerError

    table = Table("UAV", "port", "role", "mode", "t, s", "altitude, m", "airspeed, m/s", "fault tolerance", box=None)
    silent = False
    with _station(swarm, key) as station:
        words, doubts = _faults_and_beliefs(station.entry.name)
        if words:
            table.add_column("has")
            table.add_column("believes")
        if doubts:
            table.add_column("distrusts")
        for uav, state in zip(station.uavs, station.vehicles(), strict=True):
            card = station.card(uav)
            if isinstance(state, NoAnswerError):
                table.add_row(str(uav), str(card.port), card.role, "does not answer")
                silent = True
                continue
            tolerance = {None: "", True: "on", False: "off"}[state.fault_tolerance]
            said = [*(words.get(uav, ("", "")) if words else ()), *([doubts.get(uav, "")] if doubts else ())]
            numbers = (f"{state.t:.2f}", f"{state.altitude:.2f}", f"{state.airspeed:.2f}")
            table.add_row(str(uav), str(card.port), state.role, state.mode, *numbers, tolerance, *said)
    terminal().print(table)
    if silent:
        raise typer.Exit(2)


def commands() -> None:
    """List the MAVLink commands and messages that a UAV accepts, and what it does about each."""
    from rich.table import Table

    from ftcc.airside.gcs import COMMANDS, MESSAGES
    from ftcc.link.mavlink import dialect

    table = Table("MAV_CMD", "command", "what the UAV does", box=None)
    for number, command in sorted(COMMANDS.items()):
        table.add_row(str(number), dialect.enums["MAV_CMD"][number].name.removeprefix("MAV_CMD_"), command.does)
    heard = Table("message", "answer", box=None)
    for name, message in sorted(MESSAGES.items()):
        heard.add_row(name, message.does)
    out = terminal()
    out.print(table)
    out.print("\nAny other command is answered with UNSUPPORTED. Messages:\n", highlight=False)
    out.print(heard)
    out.print("\nAny other message is ignored.", highlight=False)


def fault(
    uav: Uav,
    what: Annotated[
        str,
        typer.Argument(help="What fails: aileron, elevator, rudder, thrust, bank, load_factor, position or attitude."),
    ],
    kind: Annotated[str, typer.Option(help="How it fails: wrong, off, stuck, slow or intermittent.")] = "wrong",
    effectiveness: Annotated[float | None, typer.Option(help="Remaining effectiveness, 0 to 1; default: 1.")] = None,
    bias: Annotated[float | None, typer.Option(help="Bias, in rad, N, or g for a load factor; default: 0.")] = None,
    onset: Annotated[float | None, typer.Option(help="Rate of an exponential onset, 1/s; default: a step.")] = None,
    slew: Annotated[float | None, typer.Option(help="Highest rate of a slow actuator, rad/s or N/s.")] = None,
    period: Annotated[float | None, typer.Option(help="Period of an intermittent fault, s.")] = None,
    duty: Annotated[float | None, typer.Option(help="Healthy share of the period, 0 to 1.")] = None,
    size: Annotated[
        list[str] | None,
        typer.Option(metavar="FAIL_NAME=VALUE", help="Any other failure size, see `ftcc failures`; can be repeated."),
    ] = None,
    at: At = None,
    swarm: Swarm = None,
    key: Key = None,
) -> None:
    """Inject a fault into an actuator or the navigation solution of a UAV."""
    from ftcc.groundside.swarm import sizes_of_fault

    given = {"effectiveness": effectiveness, "bias": bias, "onset": onset, "slew": slew, "period": period, "duty": duty}
    sizes = sizes_of_fault(what, kind, {name: value for name, value in given.items() if value is not None})
    for setting in size or []:
        name, _, text = setting.partition("=")
        try:
            sizes[name.lower().removeprefix("fail_")] = float(text)
        except ValueError:
            fail(f"--size {setting}: must be FAIL_NAME=NUMBER, see `ftcc failures`")
    with _station(swarm, key) as station:
        when = station.fault(uav, what, kind=kind, at=at, **sizes)
    _say(f"UAV {uav}: {what} {kind} at t = {as_seconds(round(when * 1e6))} s")


def repair(
    uav: Uav,
    what: Annotated[str | None, typer.Argument(help="What to repair; default: everything on board.")] = None,
    at: At = None,
    swarm: Swarm = None,
    key: Key = None,
) -> None:
    """Repair the actuators and the navigation of a UAV."""
    with _station(swarm, key) as station:
        station.repair(uav, what, at=at)
    _say(f"UAV {uav}: {what or 'everything on board'} repaired")


def _ends(a: int, b: int | None) -> str:
    return f"links of UAV {a}" if b is None else f"link {a} - {b}"


def _partial(problems: list[str], done: str) -> None:
    """Print what was done, and warn about the ends where it was not."""
    _say(done)
    for problem in problems:
        warn(f"done at one end only: {problem}")
    if problems:
        raise typer.Exit(_REFUSED)


@link.command("cut")
def link_cut(uav: Uav, other: Other = None, at: At = None, swarm: Swarm = None, key: Key = None) -> None:
    """Cut the links between two UAVs, or switch off the radio of one."""
    with _station(swarm, key) as station:
        problems = station.cut(uav, other, at=at)
    _partial(problems, f"{_ends(uav, other)} cut")


@link.command("restore")
def link_restore(uav: Uav, other: Other = None, at: At = None, swarm: Swarm = None, key: Key = None) -> None:
    """Restore the links between two UAVs, or the radio and all links of one."""
    with _station(swarm, key) as station:
        problems = station.restore(uav, other, at=at)
    _partial(problems, f"{_ends(uav, other)} restored")


@link.command("degrade")
def link_degrade(
    uav: Uav,
    other: Other = None,
    loss: Annotated[float | None, typer.Option(help="Probability that a record is lost, 0 to 1.")] = None,
    burst_start: Annotated[
        float | None, typer.Option(help="Probability per record that a burst of losses begins.")
    ] = None,
    burst_end: Annotated[float | None, typer.Option(help="Probability per record that the burst ends.")] = None,
    burst_loss: Annotated[float | None, typer.Option(help="Probability that a record is lost in a burst.")] = None,
    delay: Annotated[float | None, typer.Option(help="Delay beyond the link latency, s.")] = None,
    jitter: Annotated[float | None, typer.Option(help="Further random delay, uniform from 0 to this value, s.")] = None,
    at: At = None,
    swarm: Swarm = None,
    key: Key = None,
) -> None:
    """Degrade the links between two UAVs, or all links of one."""
    names = ("loss", "burst_s", "burst_e", "burst_l", "delay", "jitter")
    given = zip(names, (loss, burst_start, burst_end, burst_loss, delay, jitter), strict=True)
    sizes = {name: value for name, value in given if value is not None}
    with _station(swarm, key) as station:
        problems = station.degrade(uav, other, at=at, **sizes)
    _partial(problems, f"{_ends(uav, other)} degraded")


@param.command("get")
def param_get(
    uav: Uav,
    name: Annotated[str, typer.Argument(help="Name of the parameter, in upper or lower case.")],
    swarm: Swarm = None,
    key: Key = None,
) -> None:
    """Show the present value of a parameter."""
    with _station(swarm, key) as station:
        _say(f"{station.get(uav, name):.9g}")


@param.command("set", context_settings={"ignore_unknown_options": True})  # values may be negative
def param_set(
    uav: Uav,
    name: Annotated[str, typer.Argument(help="Name of the parameter, in upper or lower case.")],
    value: Annotated[float, typer.Argument(help="The new value.")],
    swarm: Swarm = None,
    key: Key = None,
) -> None:
    """Set a parameter; if the value is refused, the present one is kept."""
    with _station(swarm, key) as station:
        _say(f"{name} = {station.set(uav, name, value):.9g}")


@param.command("list")
def param_list(uav: Uav, swarm: Swarm = None, key: Key = None) -> None:
    """List all parameters of a UAV."""
    with _station(swarm, key) as station:
        for name, value in station.parameters(uav).items():
            _say(f"{name:16} {value:.9g}")


def leader(
    uav: Uav,
    altitude: Annotated[float | None, typer.Option(help="Altitude, m.")] = None,
    speed: Annotated[float | None, typer.Option(help="Speed, m/s.")] = None,
    at: At = None,
    swarm: Swarm = None,
    key: Key = None,
) -> None:
    """Command a leader to another altitude or speed."""
    with _station(swarm, key) as station:
        station.lead(uav, altitude=altitude, speed=speed, at=at)
    asked = [f"{altitude:g} m"] if altitude is not None else []
    asked += [f"{speed:g} m/s"] if speed is not None else []
    _say(f"UAV {uav}: commanded to {', '.join(asked)}")


def attitude(
    uav: Uav,
    bank: Annotated[float, typer.Option(help="Bank angle about the velocity, deg.")] = 0.0,
    alpha: Annotated[float, typer.Option(help="Angle of attack, deg.")] = 0.0,
    beta: Annotated[float, typer.Option(help="Sideslip angle, deg.")] = 0.0,
    swarm: Swarm = None,
    key: Key = None,
) -> None:
    """Command a UAV of an attitude scheme to another attitude (mode offboard)."""
    with _station(swarm, key) as station:
        station.attitude(uav, bank=math.radians(bank), alpha=math.radians(alpha), beta=math.radians(beta))
    _say(f"UAV {uav}: bank {bank:g}, angle of attack {alpha:g}, sideslip {beta:g} deg")


def ftc(
    uav: Uav,
    state: Annotated[str, typer.Argument(metavar="on|off", help="on or off.")],
    swarm: Swarm = None,
    key: Key = None,
) -> None:
    """Switch the fault tolerance of a UAV's control law on or off."""
    if state not in ("on", "off"):
        fail(f"ftc {state}: must be on or off")
    with _station(swarm, key) as station:
        station.fault_tolerance(uav, state == "on")
    _say(f"UAV {uav}: fault tolerance {state}")


def mode(
    uav: Uav,
    name: Annotated[str, typer.Argument(metavar="MODE", help="mission, hold or offboard.")],
    swarm: Swarm = None,
    key: Key = None,
) -> None:
    """Set the mode of a UAV: mission (its scheme flies), hold or offboard."""
    with _station(swarm, key) as station:
        station.mode(uav, name)
    _say(f"UAV {uav}: mode {name}")


# The flow of time.

_Name = Annotated[str | None, typer.Argument(help="Name of the swarm, see `ftcc ps`; needed if several are running.")]
_HOLDING = 10.0
"""Wall time within which a swarm must be held, s."""


@contextmanager
def _control(name: str | None) -> Iterator[Control]:
    """The flow of time of a swarm; a refusal ends with exit code 1, a swarm that is not there with 2."""
    from ftcc.groundside.swarm import Control, RefusedError, find_swarm

    try:
        yield Control(find_swarm(name))
    except LookupError as error:
        fail(str(error))
    except (OSError, RefusedError) as error:
        terminal(stderr=True).print(f"ftcc: {error}", style="bold red", markup=False, highlight=False)
        raise typer.Exit(_REFUSED) from None


def _wait_until_held(control: Control) -> None:
    from ftcc.groundside.swarm import RefusedError

    try:
        t = control.wait_until_held(_HOLDING)
    except (OSError, RefusedError) as error:
        fail(f"the swarm ended before it could be paused ({error})")
    _say(f"paused at t = {as_seconds(round(t * 1e6))} s")


def pause(name: _Name = None) -> None:
    """Pause a running swarm, all vehicles at the same tick."""
    with _control(name) as control:
        control.pause()
        _wait_until_held(control)


def step(
    ticks: Annotated[int, typer.Argument(min=1, help="Number of ticks.")] = 1,
    swarm: Swarm = None,
) -> None:
    """Fly a paused swarm for some ticks, then pause it again."""
    with _control(swarm) as control:
        control.step(ticks)
        _wait_until_held(control)


def resume(name: _Name = None) -> None:
    """Resume a swarm that was paused, or started with --hold."""
    with _control(name) as control:
        control.resume()


def speed(
    factor: Annotated[str, typer.Argument(help="Highest number of simulated seconds per second, or 'max'.")],
    swarm: Swarm = None,
) -> None:
    """Change the speed of a running swarm."""
    from ftcc.groundside.swarm import speed_factor

    wanted = speed_factor(factor, "speed")
    with _control(swarm) as control:
        control.speed(wanted)


# Keys.


@keys.command("new")
def keys_new(
    file: Annotated[
        Path | None, typer.Argument(help="Key file to make; default: in your configuration folder.")
    ] = None,
) -> None:
    """Make a key file for signed links; use it with `ftcc fly --key FILE`."""
    from ftcc.link.signing import KeyFileError, default_key_file, new_key_file

    path = file or default_key_file()
    try:
        new_key_file(path)
    except KeyFileError as error:
        fail(str(error))
    _say(f"wrote {path}; its line is the pass phrase for other ground stations (in MAVProxy: signing key PHRASE)")
