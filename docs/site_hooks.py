"""What MkDocs is told beside `mkdocs.yml`: equations become MathML, which browsers set without a script."""

from __future__ import annotations

import html
import logging
import re

from latex2mathml.converter import convert

_log = logging.getLogger("mkdocs.site_hooks")
_EQUATION = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)


def on_page_content(content: str, page: object, **_: object) -> str:
    """``content`` with MathML instead of LaTeX. What cannot be read is a warning, which ends a strict build."""

    def mathml(found: re.Match[str]) -> str:
        latex = html.unescape(found[3]).strip()
        try:
            return convert(latex, display="block" if found[2] == "[" else "inline")
        except Exception as error:  # the converter has no class for its errors
            _log.warning("%s: equation %r: %s", page, latex, error or type(error).__name__)
            return found[0]

    return _EQUATION.sub(mathml, content)
