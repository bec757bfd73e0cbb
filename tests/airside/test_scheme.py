"""Schemes as files: the registry, gains by form, and what a file that lacks something is told."""

from __future__ import annotations

import importlib.metadata
import math
import pkgutil
import re
from types import ModuleType
from typing import Annotated, NamedTuple

import pytest

import ftcc.airside.schemes
from ftcc.airside import schemes
from ftcc.airside.ranges import FEEDBACK
from ftcc.airside.scheme import Quantity, Scheme, SchemeError, load, quantities, rates_of
from ftcc.link.actuators import SLOT
from ftcc.link.compiled import SCHEME_ENTRY_POINTS
from ftcc.link.graph import Assumption

PUBLISHED = {
    "k11": 7.3, "k12": 24.1, "k21": 2.2, "k31": 14.0, "k41": 39.0, "k51": 5.4, "k22": 6.4, "k42": 46.0, "k52": 12.1,
    "e1": 0.01, "e2": 0.01, "l1": 2.0, "l2": 2.0, "beta1": 8.0, "beta2": 3.0, "phi": 0.1, "kappa": 1.0,
}  # fmt: skip
"""Reference: the design parameters of chapter 5."""

FLIGHT = {"k11": 3.0, "k12": 3.0, "k21": 2.0, "k31": 6.0, "k41": 20.0, "k51": 3.0, "k22": 2.0, "k42": 12.0, "k52": 6.0}
"""Reference: the gains for actuators with lag."""


@pytest.fixture
def containment() -> Scheme:
    return schemes.find("containment")


def test_every_file_of_the_folder_is_a_scheme():
    files = [info.name for info in pkgutil.iter_modules(ftcc.airside.schemes.__path__)]
    assert set(files) <= set(schemes.names())
    for name in files:
        assert schemes.find(name).name == name


def test_an_unknown_scheme_is_answered_with_those_that_exist():
    with pytest.raises(LookupError) as refusal:
        schemes.find("contaiment")
    assert "there is no scheme 'contaiment'" in str(refusal.value)
    assert "containment" in str(refusal.value)


def test_other_packages_offer_schemes_by_an_entry_point(monkeypatch, tmp_path):
    (tmp_path / "guest_scheme.py").write_text(
        "from ftcc.airside.schemes.containment import *\n"
        "from ftcc.airside.schemes.containment import SHARED, SIGNALS, GRAPH, COMMANDS, PLANT, FORMS, SWITCHES\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    entry = importlib.metadata.EntryPoint("guest", "guest_scheme", SCHEME_ENTRY_POINTS)
    offered = {SCHEME_ENTRY_POINTS: [entry]}
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: offered.get(group, []))
    schemes._modules.cache_clear()
    try:
        assert "guest" in schemes.names()
        assert schemes.find("guest").module.__name__ == "guest_scheme"
    finally:
        monkeypatch.undo()
        schemes._modules.cache_clear()
        schemes.find.cache_clear()


@pytest.mark.parametrize("name", schemes.names())
def test_what_a_scheme_declares_is_complete(name):
    scheme = schemes.find(name)
    assert scheme.title
    assert isinstance(scheme.graph, Assumption)
    assert scheme.plant in ("longitudinal", "attitude", "position")
    assert {"monograph", "flight"} <= set(scheme.forms)
    assert set(scheme.commands) <= set(SLOT)
    assert scheme.module.Output._fields[: len(scheme.commands)] == scheme.commands, "commands come first"
    for quantity in (*scheme.signals, *(q for row in scheme.shared.values() for q in row)):
        assert isinstance(quantity, Quantity)
        assert quantity.unit
    assert len({signal.name for signal in scheme.signals}) == len(scheme.signals)
    assert set(quantities(scheme.module.State)) == set(scheme.module.State._fields), "every state has name and unit"
    for settings in (*scheme.forms.values(), *scheme.switches.values()):
        assert set(settings) <= set(scheme.gains_type._fields)
    for form in scheme.forms:
        assert all(map(math.isfinite, scheme.gains(form, {})))


def test_monograph_form_has_the_published_gains(containment):
    gains = containment.gains("monograph", {})
    assert {name: getattr(gains, name) for name in PUBLISHED} == PUBLISHED


def test_flight_form_has_the_gains_for_lagging_actuators(containment):
    gains = containment.gains("flight", {})
    assert {name: getattr(gains, name) for name in FLIGHT} == FLIGHT
    assert (gains.e1, gains.e2, gains.kappa) == (0.03, 0.03, 0.0)
    assert (gains.shaper, gains.guard, gains.horizon) == (2.0, 1.0, 0.5)
    assert (gains.beta1, gains.beta2, gains.phi) == (8.0, 3.0, 0.1), "what a form does not name stays as published"


def test_overrides_come_last_and_change_nothing_else(containment):
    gains = containment.gains("flight", {"k11": 4, "phi": 0.5})
    assert gains == containment.gains("flight", {})._replace(k11=4.0, phi=0.5)
    assert isinstance(gains.k11, float)


@pytest.mark.parametrize(
    ("form", "overrides", "because"),
    [
        ("flight", {"k99": 1.0}, "scheme containment has no gain 'k99'; there are k11, k12"),
        ("flight", {"k11": math.nan}, "gain k11 = nan: must be a finite number"),
        ("flight", {"k11": math.inf}, "gain k11 = inf: must be a finite number"),
        ("fligth", {}, "scheme containment has no form 'fligth'; it has monograph, flight"),
    ],
)
def test_gains_that_are_none_are_refused(containment, form, overrides, because):
    with pytest.raises(ValueError, match=re.escape(because)):
        containment.gains(form, overrides)


def file_like(containment: Scheme, **changes: object) -> ModuleType:
    """The containment scheme's file with names replaced, or left out where None."""
    module = ModuleType("a_users_scheme", containment.module.__doc__)
    contents = {name: value for name, value in vars(containment.module).items() if not name.startswith("__")}
    for name, value in (contents | changes).items():
        if value is not None:
            setattr(module, name, value)
    return module


REQUIRED = ["Gains", "State", "Output", "SHARED", "GRAPH", "COMMANDS", "start", "step", "share"]


@pytest.mark.parametrize("name", [*REQUIRED, "SIGNALS", "observe"])
def test_a_file_that_lacks_something_is_refused_with_what_it_lacks(containment, name):
    with pytest.raises(TypeError, match=rf"scheme mine \(a_users_scheme\) lacks {name}$"):
        Scheme("mine", file_like(containment, **{name: None}))


def test_what_a_file_may_leave_out_has_its_default(containment):
    scheme = Scheme("mine", file_like(containment, PLANT=None, FORMS=None, SWITCHES=None, check=None))
    assert (scheme.plant, scheme.forms, scheme.switches) == ("longitudinal", {"flight": {}}, {})
    assert scheme.check(scheme.gains("flight", {}), None) == []


class ShownOutput(NamedTuple):
    thrust: float
    elevator: float
    S1: Annotated[float, Quantity("S1", "m")]


def test_without_signals_all_states_are_recorded_and_all_outputs_that_are_no_commands(containment):
    scheme = Scheme("mine", file_like(containment, SIGNALS=None, observe=None, Output=ShownOutput))
    states = [quantity.name for quantity in quantities(containment.module.State).values()]
    assert [signal.name for signal in scheme.signals] == [*states, "S1"]
    with pytest.raises(TypeError, match=r"outputs zhat_rate, S1, .*thrust_wanted have no Quantity"):
        Scheme("mine", file_like(containment, SIGNALS=None, observe=None))


def test_everything_that_is_missing_is_said_at_once():
    with pytest.raises(TypeError, match=r"lacks Gains, State, Output, SHARED.*start, step, share"):
        load("empty", "ftcc.airside.model")


def test_a_gain_without_unit_and_meaning_is_refused(containment):
    class Gains(NamedTuple):
        k: float

    with pytest.raises(TypeError, match="gains k have no Quantity"):
        Scheme("mine", file_like(containment, Gains=Gains))


def test_a_gain_that_nobody_gave_a_value_must_be_given(containment):
    class Gains(NamedTuple):
        k: Annotated[float, Quantity("k", "1/s")]

    scheme = Scheme("mine", file_like(containment, Gains=Gains, FORMS={"flight": {}}, RANGES={}, SWITCHES={}))
    with pytest.raises(ValueError, match="gains k have no published value and must be given"):
        scheme.gains("flight", {})
    assert scheme.gains("flight", {"k": 2.0}).k == 2.0


def test_a_range_of_a_gain_that_there_is_not_is_refused(containment):
    with pytest.raises(SchemeError, match="RANGES names k99, which is no gain"):
        Scheme("mine", file_like(containment, RANGES={FEEDBACK: "k11 k99"}))


ROLES = {
    "attitude_synchronization": {
        "estimate": ["d_p", "d_q", "d_r"],
        "adapted": ["theta1", "theta2"],
        "reference": ["mu_d", "alpha_d", "beta_d"],
    },
    "containment": {"error": ["S1", "S5"], "estimate": ["d1_hat", "d2_hat", "lumped_hat"]},
    "fire_monitoring": {
        "error": ["Pt_x", "Pt_y", "Pt_z", "e_x", "e_y", "e_z"],
        "estimate": ["Dhat_x", "Dhat_y", "Dhat_z"],
        "reference": ["x_ref", "y_ref", "z_ref"],
    },
    "prescribed_performance": {"error": ["E2"], "adapted": ["F_gamma", "F_q"]},
}
"""Signals without a bound, by scheme and role."""


@pytest.mark.parametrize("scheme", ROLES)
def test_signals_have_the_roles_by_which_they_are_plotted_and_judged(scheme):
    """A meaning that is worded anew must not take a plot away."""
    found: dict[str, list[str]] = {}
    for signal in schemes.find(scheme).signals:
        if signal.shown_as != "plain" and signal.bound is None:
            found.setdefault(signal.shown_as, []).append(signal.name)
    assert found == ROLES[scheme]


def test_a_declared_role_counts_more_than_words():
    assert Quantity("e", "m", "tracking error").shown_as == "error"
    assert Quantity("e", "m", "tracking error", role="plain").shown_as == "plain"
    assert Quantity("r", "rad/s^2", "what the control does not explain", role="estimate").shown_as == "estimate"


@pytest.mark.parametrize("scheme", schemes.names())
def test_of_what_neighbours_share_every_rate_is_known_as_one(scheme):
    """By unit: m/s of m, rad/s of rad, m/s^2 of m/s; every scheme shares values with their rates beside them."""
    for role, shared in schemes.find(scheme).shared.items():
        for column, value in zip(rates_of(shared), shared, strict=True):
            slower = shared[column].unit if column >= 0 else ""
            assert (
                value.unit in ({"m": "m/s", "rad": "rad/s", "m/s": "m/s^2"}[slower],) if slower else ("m", "m/s", "rad")
            )
            assert column >= 0 or any(other.rate_of == value.name for other in shared), (role, value.name)


def test_a_rate_of_what_is_not_shared_is_refused(containment):
    shared = {"follower": (Quantity("z", "m"), Quantity("v", "m/s", rate_of="y")), "leader": ()}
    with pytest.raises(
        SchemeError, match=r"SHARED\[\"follower\"\]: v is called the rate of 'y'; shared beside it are z"
    ):
        Scheme("mine", file_like(containment, SHARED=shared))
