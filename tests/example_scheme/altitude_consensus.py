"""Altitude consensus behind a leader, with integral action against faults.

Each follower moves its reference towards the weighted mean of what its neighbours tell, and tracks it with cascaded
loops; integrators find the trim that a fault or a disturbance has moved.
"""

from typing import Annotated, NamedTuple

from ftcc.airside import ranges
from ftcc.airside.elements.nonlinear import clip
from ftcc.airside.scheme import Quantity
from ftcc.link.compiled import compiled
from ftcc.link.graph import Assumption

Q = Quantity


class Gains(NamedTuple):
    k_c: Annotated[float, Q("k_c", "1/s", "consensus", 1.0)]
    k_z: Annotated[float, Q("k_z", "1/s", "altitude", 0.6)]
    k_theta: Annotated[float, Q("k_theta", "1/s", "pitch", 2.5)]
    k_q: Annotated[float, Q("k_q", "s", "pitch rate to elevator", 0.15)]
    k_V: Annotated[float, Q("k_V", "N s/m", "speed to thrust", 50.0)]
    k_I: Annotated[float, Q("k_I", "1/s", "integral action of all loops", 1.0)]
    climb: Annotated[float, Q("climb", "m/s", "largest climb rate of the reference", 2.0)]


class State(NamedTuple):
    z_r: Annotated[float, Q("z_r", "m", "altitude reference")]
    theta_0: Annotated[float, Q("theta_0", "rad", "pitch in level flight")]
    elevator_0: Annotated[float, Q("elevator_0", "rad", "elevator in trim")]
    thrust_0: Annotated[float, Q("thrust_0", "N", "thrust in trim")]


class Output(NamedTuple):
    thrust: float
    elevator: float
    S1: Annotated[float, Q("S1", "m", "altitude tracking error")]
    S2: Annotated[float, Q("S2", "m/s", "speed tracking error")]


SHARED = {"follower": (Q("z_r", "m", "altitude reference"),), "leader": (Q("z", "m", "altitude"),)}
GRAPH = Assumption.LEADERS_REACH_ALL
COMMANDS = ("thrust", "elevator")
SWITCHES = {"fault_tolerance": {"k_I": 0.0}}
RANGES = {ranges.FEEDBACK: "k_c k_z k_theta k_q k_V", ranges.COUPLING: "k_I", ranges.LIMIT: "climb"}


@compiled
def start(own, heard, reference, model, gains):
    return State(own.z, own.theta, own.elevator, own.thrust)


@compiled
def step(s, own, heard, reference, model, gains, dt):
    pull = 0.0
    for j in range(heard.weight.shape[0]):
        pull += heard.valid[j] * heard.weight[j] * heard.trust[j, 0] * (heard.values[j, 0] - s.z_r)
    rate = clip(gains.k_c * pull, -gains.climb, gains.climb)
    S1, S2 = own.z - s.z_r, own.V - reference.V
    gamma = clip((rate - gains.k_z * S1) / own.V, -0.15, 0.15)
    error = own.q - gains.k_theta * (s.theta_0 + gamma - own.theta)
    elevator = clip(s.elevator_0 + gains.k_q * error, model.elevator_min, model.elevator_max)
    thrust = clip(s.thrust_0 - gains.k_V * S2, model.thrust_min, model.thrust_max)
    h = gains.k_I * dt
    theta_0 = s.theta_0 - h * clip(0.1 * S1 / own.V, -0.01, 0.01)
    trim = State(s.z_r + rate * dt, theta_0, s.elevator_0 + h * error, s.thrust_0 - h * 10.0 * clip(S2, -1.0, 1.0))
    return trim, Output(thrust, elevator, S1, S2)


@compiled
def share(state, own, reference, output, gains):
    return (state.z_r,)
