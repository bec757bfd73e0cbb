"""Removes from an environment what no flight, report or study loads: ``python slim.py FOLDER [--no-viewer]``.

For images alone. docs/containers.md says how much is left.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

_DIALECT = "common"
"""Of MAVLink 2; pymavlink brings some thirty."""
_HEADERS = ("include", "*.pyx", "*.pxi", "*.pxd")
"""Of pyarrow, for those who compile against it."""
_BINARIES = ("rerun_cli/rerun", "rerun_bindings/*.so", "llvmlite/binding/*.so")
"""Hold symbols that only a debugger reads."""
_TESTED = ("numpy", "scipy", "numba", "pyarrow", "matplotlib", "pandas", "distributed", "dask")


def unneeded(packages: Path, with_viewer: bool) -> Iterator[Path]:
    """Files and folders that nothing here loads."""
    for dialects in (packages / "pymavlink" / "dialects").glob("v*"):
        if dialects.name != "v20":
            yield dialects
        else:
            yield from (path for path in dialects.iterdir() if path.stem not in (_DIALECT, "__init__"))
    yield from (packages / "pymavlink").glob("message_definitions")
    for name in _TESTED:
        yield from (path for path in (packages / name).rglob("tests") if path.is_dir())
    for pattern in _HEADERS:
        yield from (packages / "pyarrow").glob(pattern)
    yield from packages.glob("pip*")
    if not with_viewer:
        yield packages / "rerun_cli"


def main(environment: Path, with_viewer: bool) -> None:
    """Slim a virtual environment; without the viewer it is one for the workers of studies."""
    (packages,) = environment.glob("lib/python3*/site-packages")
    for path in list(unneeded(packages, with_viewer)):
        shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
    for pattern in _BINARIES:
        for binary in packages.glob(pattern):
            subprocess.run(["strip", binary], check=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), "--no-viewer" not in sys.argv)
