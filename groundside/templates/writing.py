"""Write the package of a control law from the templates beside this file."""

from __future__ import annotations

import importlib.util
import keyword
import re
from pathlib import Path

from ftcc.airside import schemes
from ftcc.groundside.errors import UserError

__all__ = ["TemplateError", "write_law"]

_LAW = Path(__file__).parent / "law"


class TemplateError(UserError):
    """A name or a folder that cannot be used; nothing has been written."""


def write_law(name: str, folder: Path) -> list[Path]:
    """Write a package with the control law ``name`` into the new, or empty, ``folder``.

    Parameters
    ----------
    name : str
        Of the law, its module and its scenario: lower case, an identifier that no other scheme or module has.
    folder : Path

    Returns
    -------
    list of Path
        The files: the law first.

    Raises
    ------
    TemplateError
        For a name or a folder that is taken, or cannot be used; what is in the folder stays as it is.
    """
    _check_name(name)
    try:
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise TemplateError(f"{folder}: exists and is not an empty folder; what is in it stays as it is")
        folder.mkdir(parents=True, exist_ok=True)
        return _write(name, folder)
    except OSError as error:
        raise TemplateError(f"{folder}: cannot be written: {error.strerror or error}") from None


def _check_name(name: str) -> None:
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name) or keyword.iskeyword(name):
        raise TemplateError(
            f"--law {name}: must be a name for a Python module, of lower-case letters, digits and _, such as my_law"
        )
    if name in schemes.names():
        raise TemplateError(f"--law {name}: there is such a scheme already; there are {', '.join(schemes.names())}")
    if name.startswith("test_") or importlib.util.find_spec(name) is not None:
        raise TemplateError(f"--law {name}: a Python module has this name already; choose another one")


def _write(name: str, folder: Path) -> list[Path]:
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_LAW), undefined=jinja2.StrictUndefined, keep_trailing_newline=True
    )
    words = {
        "name": name,
        "title": name.replace("_", " ").capitalize(),
        "distribution": f"ftcc-{name.replace('_', '-')}",
    }
    files = {
        f"{name}.py": "law.py.jinja",
        f"{name}.toml": "scenario.toml.jinja",
        f"test_{name}.py": "test.py.jinja",
        "pyproject.toml": "pyproject.toml.jinja",
        "README.md": "README.md.jinja",
    }
    written = []
    for file, template in files.items():
        path = folder / file
        path.write_text(environment.get_template(template).render(words), encoding="utf-8")
        written.append(path)
    return written
