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
        require("pandas", "to_pandas", "to_arrow()")
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
        return require("polars", "to_polars", "to_arrow()").from_arrow(self.to_arrow())

    def to_xarray(self) -> Any:
        """All columns as an ``xarray.Dataset`` of dimensions ``time`` (s) and ``uav`` (id); nan where there is no row.

        Unit and meaning of a column are its ``attrs["units"]`` and ``attrs["long_name"]``.

        Raises
        ------
        MissingPackageError
            If xarray is not installed.
        """
        xarray = require("xarray", "to_xarray", "to_arrow()")
        table = self.to_arrow()
        rows = {name: table.column(name).to_numpy() for name in ("t", "uav")}
        time, instant = np.unique(rows["t"], return_inverse=True)
        uav, place = np.unique(rows["uav"], return_inverse=True)
        notes = {
            field.name: {"units": field.metadata[b"unit"].decode(), "long_name": field.metadata[b"meaning"].decode()}
            for field in table.schema
        }
        variables = {}
        for name in table.column_names:
            if name not in rows:
                values = np.full((len(time), len(uav)), np.nan)
                values[instant, place] = table.column(name).to_numpy()
                variables[name] = (("time", "uav"), values, notes[name])
        mission = self.mission
        return xarray.Dataset(
            variables,
            {"time": ("time", time, notes["t"]), "uav": ("uav", uav, notes["uav"])},
            {"scenario": mission.name, "case": mission.case, "seed": mission.timing.seed},
        )

    def claims(self) -> list[Result]:
        """Compare the claims of the flight's case with the recording; see `claims.Result`."""
        from ftcc.groundside.claims import evaluate

        mission = self.mission
        return evaluate(self, mission.claims, mission.case, mission.graph, mission.timing.duration)


def require(package: str, purpose: str, instead: str, install: str = "") -> Any:
    """Import an optional package.

    Parameters
    ----------
    package : str
        Name of the module to import.
    purpose : str
        What needs it.
    instead : str
        What does without it.
    install : str, optional
        What pip installs; default: the package.

    Raises
    ------
    MissingPackageError
        If it is not installed.
    """
    wanted = package.partition(".")[0]
    try:
        importlib.import_module(wanted)
    except ModuleNotFoundError as error:
        if error.name != wanted:
            raise
        raise MissingPackageError(
            f"{purpose}: {wanted} is not installed; install it with: pip install {install or wanted}, or use {instead}"
        ) from None
    return importlib.import_module(package)
