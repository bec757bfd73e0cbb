"""What ``ftcc --version`` tells."""

from __future__ import annotations

__all__ = ["show_versions", "versions"]

_TOLD = ("ftcc-sitl", "pymavlink", "numba", "numpy", "scipy", "eclipse-zenoh", "rerun-sdk")
"""Distributions that decide what flies, what is heard and what is shown; none of them is loaded."""


def versions() -> dict[str, str]:
    """Versions by name, and the machine's platform."""
    import platform
    from importlib.metadata import PackageNotFoundError, version

    found = {}
    for name in _TOLD:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    own, *others = found.items()
    return dict([own, ("python", platform.python_version()), *others, ("platform", platform.platform())])


def show_versions(as_json: bool) -> None:
    """Print them, for people or for programs."""
    import json

    told = versions()
    print(json.dumps(told, indent=2) if as_json else "\n".join(f"{name} {version}" for name, version in told.items()))
