"""What a recorded flight offers, be it in memory or in a folder: whole tables, and its claims."""

from __future__ import annotations

import abc
import importlib
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ftcc.groundside.errors import UserError

if TYPE_CHECKING:
    from ftcc.groundside.claims import Result
    from ftcc.groundside.scenario import Mission

__all__ = ["MissingPackageError", "Recording", "require"]


class MissingPackageError(UserError):
    """A package is not installed that is needed only where it is asked for."""


class Recording(abc.ABC):
    """The recording of a flight: its mission, its columns by UAV, and what follows from them."""

    mission: Mission
    """The scenario resolved: graph, scheme, timing, claims."""

    @property
    @abc.abstractmethod
    def uavs(self) -> tuple[int, ...]:
        """Ids of the UAVs, ascending."""

    @property
    @abc.abstractmethod
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""

    @abc.abstractmethod
    def column(self, name: str, uav: int) -> NDArray[np.float64]:
        """A column of one UAV in order of time."""

    @abc.abstractmethod
    def to_arrow(self) -> Any:
        """All columns as a ``pyarrow.Table``: a row per recorded tick and UAV, by time, then UAV.

        Unit and meaning of each column are in its field's metadata.
        """

    def to_pandas(self) -> Any:
        """All columns as a ``pandas.DataFrame``, the rows of `to_arrow`; ``attrs["units"]`` holds the units by column.

        Raises
        ------
        MissingPackageError
            If pandas is not installed.
        """
        require("pandas", "to_arrow()")
        table = self.to_arrow()
        frame = table.to_pandas()
        frame.attrs["units"] = {field.name: field.metadata[b"unit"].decode() for field in table.schema}
        return frame

    def to_polars(self) -> Any:
        """All columns as a ``polars.DataFrame``, the rows of `to_arrow`; polars keeps no units.

        Raises
        ------
        MissingPackageError
            If polars is not installed.
        """
        return require("polars", "to_arrow()").from_arrow(self.to_arrow())

    def claims(self) -> list[Result]:
        """Compare the claims of the flight's case with the recording; see `claims.Result`."""
        from ftcc.groundside.claims import evaluate

        mission = self.mission
        return evaluate(self, mission.claims, mission.case, mission.graph, mission.timing.duration)


def require(package: str, instead: str) -> Any:
    """Import an optional package; ``instead`` names what does without it.

    Raises
    ------
    MissingPackageError
        If it is not installed.
    """
    try:
        return importlib.import_module(package)
    except ModuleNotFoundError as error:
        if error.name != package:
            raise
        raise MissingPackageError(
            f"to_{package}: {package} is not installed; install it with: pip install {package}, or use {instead}"
        ) from None
