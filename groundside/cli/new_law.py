"""What ``ftcc new --law NAME DIR`` does: the package of a control law to begin with."""

from __future__ import annotations

from pathlib import Path

from ftcc.groundside.cli.common import terminal

__all__ = ["new_law"]


def new_law(name: str, folder: Path) -> None:
    """Write the package and print what to type next."""
    from ftcc.groundside.templates import write_law

    files = write_law(name, folder)
    out = terminal()
    for text in (
        f"{folder}: {', '.join(file.name for file in files)}",
        f"install it once: pip install -e {folder}",
        f"fly it: ftcc simulate {folder / name}.toml",
        f"change it: {files[0]}; every edit takes effect at the next start",
    ):
        out.print(text, markup=False, highlight=False, soft_wrap=True)
