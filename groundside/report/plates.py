"""Draw figures into a report's folder: for its page, and in the size and type of a journal, each with its LaTeX."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ftcc.groundside.canvas import LOOKS, PAGE, Drawn, Look, save
from ftcc.groundside.errors import UserError

__all__ = ["Plates", "look_of"]

_SPECIAL = str.maketrans(
    {c: f"\\{c}" for c in "&%$#_{}"} | {"~": r"\textasciitilde{}", "^": r"\^{}", "\\": r"\textbackslash{}"}
)


def look_of(style: str | None) -> Look:
    """Return a look by its name; None: that of the page.

    Raises
    ------
    UserError
        If there is no such style.
    """
    if style is None:
        return PAGE
    if style not in LOOKS:
        raise UserError(f"style {style!r}: there is {', '.join(LOOKS)}")
    return LOOKS[style]


@dataclasses.dataclass(frozen=True)
class Plates:
    """Draws figures into a folder, and those of another look into a folder of its name there."""

    folder: Path
    look: Look = PAGE
    flight: str = ""
    """What flew, for captions."""

    def add(self, name: str, title: str, number: str, draw: Callable[[Look], Any | None]) -> Drawn | None:
        """Draw a figure, write its files and its LaTeX; None if ``draw`` finds nothing to draw."""
        made = draw(PAGE)
        if made is None:
            return None
        drawn = save(made, name, title, number, self.folder)
        self._write_latex(drawn, PAGE, self.folder)
        if self.look is PAGE:
            return dataclasses.replace(drawn, latex=self._latex(drawn, PAGE))
        folder = self.folder / self.look.name
        styled = save(draw(self.look), name, title, number, folder, self.look)
        self._write_latex(styled, self.look, folder)
        return dataclasses.replace(drawn, latex=self._latex(drawn, self.look))

    def _write_latex(self, drawn: Drawn, look: Look, folder: Path) -> None:
        (folder / f"{drawn.name}.tex").write_text(self._latex(drawn, look) + "\n", encoding="utf-8")

    def _latex(self, drawn: Drawn, look: Look) -> str:
        """Return what includes a figure in a paper; its files lie beside the paper or in ``\\graphicspath``."""
        caption = f"{drawn.title} ({self.flight})." if self.flight else f"{drawn.title}."
        width = r"\columnwidth" if look.is_narrow else r"\textwidth"
        return "\n".join(
            (
                rf"\begin{{{look.floating}}}",
                r"  \centering",
                rf"  \includegraphics[width={width}]{{{drawn.name}.pdf}}",
                rf"  \caption{{{caption.translate(_SPECIAL)}}}",
                rf"  \label{{fig:{drawn.name}}}",
                rf"\end{{{look.floating}}}",
            )
        )
