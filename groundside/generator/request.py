"""What a user asks for, in one line: a scheme, a size, a graph, faults and losses."""

from __future__ import annotations

from dataclasses import dataclass

from ftcc.airside.scheme import Scheme
from ftcc.airside.schemes import find as find_scheme
from ftcc.airside.schemes import names as scheme_names
from ftcc.groundside.generator.graphs import RequestError
from ftcc.groundside.scenario import read, shipped
from ftcc.link.graph import Assumption

__all__ = ["MOST_UAVS", "Request"]

MOST_UAVS = 200
"""As many as a scenario may have."""
_LIKE = {"longitudinal": "containment", "attitude": "attitude_synchronization", "position": "fire_monitoring"}
"""By plant the shipped scenario after which one for a law from elsewhere is made."""


@dataclass(frozen=True)
class Request:
    """A swarm that is wanted. Ids count from 1, followers first."""

    scheme: str = "containment"
    followers: int = 6
    leaders: int | None = None
    """None: as many as the scheme needs."""
    graph: str = "ring"
    directed: bool = False
    """Whether records go one way along each edge."""
    seed: int = 1
    spacing: float = 40.0
    """Between neighbours abreast, m; around a fire the least distance between two posts."""
    faults: int = 1
    loss: float = 0.0
    """Share of records lost."""
    duration: float = 60.0
    """s."""

    def __post_init__(self) -> None:
        for option, value, least, most in (
            ("followers", self.followers, 1, MOST_UAVS),
            ("leaders", self.leaders, 0, MOST_UAVS),
            ("followers and --leaders together", self.followers + (self.leaders or 0), 1, MOST_UAVS),
            ("spacing", self.spacing, 1.0, 1000.0),
            ("loss", self.loss, 0.0, 0.9),
            ("duration", self.duration, 40.0, 3600.0),
            ("faults", self.faults, 0, self.followers),
            ("seed", self.seed, 0, 2**32 - 1),
        ):
            if value is not None and not least <= value <= most:
                why = ", one for each follower" if option == "faults" else ""
                raise RequestError(f"--{option} {value:g}: must be from {least:g} to {most:g}{why}")

    def law(self) -> Scheme:
        """Return the scheme that is asked for.

        Raises
        ------
        RequestError
            If there is none of that name.
        """
        if self.scheme not in scheme_names():
            raise RequestError(
                f"--scheme {self.scheme}: there is no such scheme; there are {', '.join(scheme_names())}"
            )
        return find_scheme(self.scheme)

    def leader_count(self, scheme: Scheme) -> int:
        """Return how many leaders fly.

        Raises
        ------
        RequestError
            If the scheme has no leaders and some are asked for, or the other way round.
        """
        if scheme.plant != "longitudinal":
            if self.leaders:
                raise RequestError(f"--leaders {self.leaders}: scheme {scheme.name} has no leaders; leave it out")
            return 0
        usual = 1 if scheme.graph is Assumption.ONE_LEADER_UNDIRECTED else 2
        wanted = usual if self.leaders is None else self.leaders
        if not 1 <= wanted <= self.followers:
            raise RequestError(
                f"--leaders {wanted}: scheme {scheme.name} needs from 1 to as many as there are followers, "
                f"{self.followers}"
            )
        return wanted

    def example(self, scheme: Scheme) -> str:
        """Return the name of the shipped scenario whose aircraft and rates are taken: the scheme's own, or one like it.

        Raises
        ------
        RequestError
            If none flies the scheme's plant.
        """
        flown = {name: read(path)["scheme"] for name, path in shipped().items()}
        if self.scheme in flown.values():
            return next(name for name in (self.scheme, *flown) if flown.get(name) == self.scheme)
        if scheme.plant not in _LIKE:
            raise RequestError(
                f"--scheme {self.scheme}: flies on plant {scheme.plant}, for which no scenario can be made; "
                f"there are {', '.join(_LIKE)}"
            )
        return _LIKE[scheme.plant]
