"""Find and load an aircraft of JSBSim."""

from __future__ import annotations

import math
import os
import tempfile
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import jsbsim

__all__ = ["MODEL_STEP", "Aircraft", "JsbsimError", "file_of", "load", "package", "parts_of", "shipped"]

MODEL_STEP = 1.0 / 120.0
"""Longest integration step of JSBSim that its aircraft are made for, s."""

_OF_THE_OUTER_WORLD = ("input", "output")
"""Elements of an aircraft that open sockets or write files."""


class JsbsimError(ValueError):
    """JSBSim is not installed, or cannot load or fly an aircraft; the text is one line."""


@dataclass(frozen=True)
class Aircraft:
    """An aircraft of JSBSim, as a scenario names it."""

    name: str
    """Of an aircraft in the package, or the path of an XML file."""
    properties: tuple[tuple[str, float], ...] = ()
    """JSBSim properties that are set before the flight, such as fuel, flaps or the type of turbulence."""

    @property
    def title(self) -> str:
        """Its name, for people."""
        return Path(self.name).stem


def package() -> Any:
    """Return the package ``jsbsim``, silent.

    Raises
    ------
    JsbsimError
        If it is not installed.
    """
    os.environ.setdefault("JSBSIM_DEBUG", "0")  # JSBSim prints a banner otherwise; read when it is loaded
    try:
        import jsbsim
    except ImportError as error:
        raise JsbsimError("JSBSim is not installed: pip install 'ftcc-sitl[jsbsim]'") from error
    return jsbsim


def _root() -> Path:
    return Path(str(package().__file__)).parent


def shipped() -> list[str]:
    """Names of the aircraft in the package."""
    folder = _root() / "aircraft"
    return sorted(one.name for one in folder.iterdir() if (one / f"{one.name}.xml").is_file())


def file_of(aircraft: Aircraft) -> Path:
    """Return the XML file of an aircraft.

    Raises
    ------
    JsbsimError
        If there is none.
    """
    given = Path(aircraft.name)
    if given.suffix == ".xml":
        if not given.is_file():
            raise JsbsimError(f"{given}: there is no such file")
        return given.resolve()
    file = _root() / "aircraft" / aircraft.name / f"{aircraft.name}.xml"
    if not file.is_file():
        raise JsbsimError(
            f"JSBSim has no aircraft {aircraft.name!r}; it has {', '.join(shipped())}; or give an XML file"
        )
    return file


def parts_of(step_us: int) -> int:
    """Steps of JSBSim in one of ours (us)."""
    return max(1, math.ceil(step_us / 1e6 / MODEL_STEP - 1e-9))


def load(aircraft: Aircraft, step_us: int = 5000) -> jsbsim.FGFDMExec:
    """Load an aircraft, without what opens sockets or writes files.

    Parameters
    ----------
    aircraft : Aircraft
    step_us : int
        Step of our plant, us; JSBSim's own is the same, or a whole part of it that is at most `MODEL_STEP`.

    Raises
    ------
    JsbsimError
        If it cannot be loaded, or has no property of a given name.
    """
    file = file_of(aircraft)
    try:
        tree = ElementTree.parse(file)
    except ElementTree.ParseError as error:
        raise JsbsimError(f"{file}: is no XML: {error}") from error
    root = tree.getroot()
    if root.tag != "fdm_config":
        raise JsbsimError(f"{file}: is no aircraft of JSBSim: its root is <{root.tag}>, must be <fdm_config>")
    for element in [child for child in root if child.tag in _OF_THE_OUTER_WORLD]:
        root.remove(element)
    said = _listen(package())
    model: jsbsim.FGFDMExec = package().FGFDMExec(None)
    model.set_dt(step_us / 1e6 / parts_of(step_us))  # before it is loaded: its filters take the step then
    with tempfile.TemporaryDirectory(prefix="ftcc-") as folder:
        # JSBSim reads FOLDER/NAME/NAME.xml, and what it refers to beside it.
        home = Path(folder) / file.stem
        home.mkdir()
        for beside in file.parent.iterdir():
            if beside.name != f"{file.stem}.xml":
                (home / beside.name).symlink_to(beside)
        tree.write(home / f"{file.stem}.xml")
        paths = (folder, str(_root() / "engine"), str(_root() / "systems"))
        try:
            loaded = model.load_model_with_paths(file.stem, *paths)
        except Exception as error:  # JSBSim's errors have no common class
            raise JsbsimError(f"{aircraft.name}: {_one_line(str(error), folder)}") from error
    if not loaded:
        raise JsbsimError(f"{aircraft.name}: {_one_line(said.last, folder) or 'JSBSim cannot load it'}")
    for name, value in aircraft.properties:
        if not model.get_property_manager().hasNode(name):
            raise JsbsimError(f"{aircraft.name}: has no property {name}")
        model[name] = value
    return model


def _one_line(text: str, folder: str) -> str:
    """Return a message of JSBSim as a line, without the folder from which it read."""
    return " ".join(text.replace(f"{folder}/", "").split())


def _listen(jsbsim: Any) -> Any:
    """Make JSBSim, which prints all it has to say, keep it; the last error is ``last``."""

    class Listener(jsbsim.FGLogger):  # type: ignore[misc]
        last = ""
        text = ""

        def set_level(self, level: Any) -> None:
            self.level, self.text = level, ""

        def file_location(self, filename: str, line: int) -> None:
            self.text += f"{filename}:{line}: "

        def message(self, message: str) -> None:
            self.text += message

        def format(self, format: Any) -> None:
            """Colours, of which nothing is kept."""

        def flush(self) -> None:
            if self.level in (jsbsim.LogLevel.ERROR, jsbsim.LogLevel.FATAL):
                self.last = self.text

    listener = Listener()
    jsbsim.set_logger(listener)
    return listener
