"""Exports for maps: KML (Google Earth) and GPX, with a track per UAV."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ftcc.groundside.palette import colors
from ftcc.groundside.results.folders import RunError
from ftcc.groundside.results.run import Run
from ftcc.link.home import Home

__all__ = ["Point", "track", "write_gpx", "write_kml"]

_RATE = 10.0
"""Most points in a simulated second, Hz."""
_KML = "http://www.opengis.net/kml/2.2"
_GOOGLE = "http://www.google.com/kml/ext/2.2"
_GPX = "http://www.topografix.com/GPX/1/1"


class Point(NamedTuple):
    """A position at a time."""

    time: str
    """UTC in the format of XML: the run's start plus the simulated time."""
    latitude: float
    longitude: float
    """deg."""
    altitude: float
    """m above mean sea level."""


def track(run: Run, uav: int) -> list[Point]:
    """Return a UAV's true positions at up to 10 Hz, with the first and the last; empty if none was recorded."""
    home = Home(*run.mission.home)
    columns = [run.column(name, uav) for name in ("t", "x", "y", "z")]
    t, x, y, z = (column[np.isfinite(np.sum(columns, axis=0))] for column in columns)
    last = -math.inf
    points = []
    for i, now in enumerate(t.tolist()):
        if now - last < 0.999 / _RATE and i < len(t) - 1:
            continue
        last = now
        latitude, longitude = home.place(float(x[i]), float(y[i]))
        when = datetime.fromtimestamp(run.started + now, UTC).isoformat(timespec="milliseconds")
        points.append(Point(when.replace("+00:00", "Z"), latitude / 1e7, longitude / 1e7, home.altitude + float(z[i])))
    return points


def write_kml(run: Run, file: Path) -> None:
    """Write a KML file: a ``gx:Track`` per UAV, with its colour, under its altitudes above mean sea level.

    Raises
    ------
    RunError
        If no positions were recorded.
    OSError
        If it cannot be written.
    """
    root = ET.Element(f"{{{_KML}}}kml")
    document = ET.SubElement(root, f"{{{_KML}}}Document")
    _text(document, _KML, "name", run.mission.title)
    shades = colors(run.mission.uavs)
    for uav, points in _tracks(run):
        mark = ET.SubElement(document, f"{{{_KML}}}Placemark", id=f"uav{uav}")
        _text(mark, _KML, "name", f"UAV {uav}")
        style = ET.SubElement(mark, f"{{{_KML}}}Style")
        line = ET.SubElement(style, f"{{{_KML}}}LineStyle")
        red, green, blue = shades[uav]
        _text(line, _KML, "color", f"ff{blue:02x}{green:02x}{red:02x}")
        _text(line, _KML, "width", "2")
        flown = ET.SubElement(mark, f"{{{_GOOGLE}}}Track")
        _text(flown, _KML, "altitudeMode", "absolute")
        for point in points:
            _text(flown, _KML, "when", point.time)
        for point in points:
            _text(flown, _GOOGLE, "coord", f"{point.longitude:.7f} {point.latitude:.7f} {point.altitude:.3f}")
    _write(root, file, {"": _KML, "gx": _GOOGLE})


def write_gpx(run: Run, file: Path) -> None:
    """Write a GPX 1.1 file: a ``trk`` per UAV.

    Raises
    ------
    RunError
        If no positions were recorded.
    OSError
        If it cannot be written.
    """
    root = ET.Element(f"{{{_GPX}}}gpx", version="1.1", creator="FTCC-SITL")
    metadata = ET.SubElement(root, f"{{{_GPX}}}metadata")
    _text(metadata, _GPX, "name", run.mission.title)
    for uav, points in _tracks(run):
        flown = ET.SubElement(root, f"{{{_GPX}}}trk")
        _text(flown, _GPX, "name", f"UAV {uav}")
        segment = ET.SubElement(flown, f"{{{_GPX}}}trkseg")
        for point in points:
            place = {"lat": f"{point.latitude:.7f}", "lon": f"{point.longitude:.7f}"}
            at = ET.SubElement(segment, f"{{{_GPX}}}trkpt", place)
            _text(at, _GPX, "ele", f"{point.altitude:.3f}")
            _text(at, _GPX, "time", point.time)
    _write(root, file, {"": _GPX})


def _tracks(run: Run) -> Iterator[tuple[int, list[Point]]]:
    """Yield each UAV that has a track, with its points."""
    found = [(uav, points) for uav in run.uavs if (points := track(run, uav))]
    if not found:
        raise RunError(f"{run.path}: no positions were recorded")
    yield from found


def _text(parent: ET.Element, space: str, name: str, text: str) -> None:
    ET.SubElement(parent, f"{{{space}}}{name}").text = text


def _write(root: ET.Element, file: Path, spaces: dict[str, str]) -> None:
    for prefix, space in spaces.items():
        ET.register_namespace(prefix, space)
    ET.indent(root)
    ET.ElementTree(root).write(file, encoding="UTF-8", xml_declaration=True)
