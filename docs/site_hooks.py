"""What MkDocs is told beside `mkdocs.yml`.

Equations become MathML, which browsers set without a script. The one script that the theme would fetch from elsewhere
is taken from here.
"""

from __future__ import annotations

import html
import logging
import re
from typing import Any

from latex2mathml.converter import convert
from mkdocs.utils import get_relative_url

_log = logging.getLogger("mkdocs.site_hooks")
_ELSEWHERE = "https://unpkg.com/iframe-worker/shim"
_HERE = "docs/javascripts/iframe-worker.js"
_EQUATION = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)


def on_page_content(content: str, page: object, **_: object) -> str:
    """``content`` with MathML instead of LaTeX. What cannot be read is a warning, which ends a strict build."""

    def mathml(found: re.Match[str]) -> str:
        # The converter knows `aligned` by its other name alone.
        latex = html.unescape(found[3]).strip().replace("{aligned}", "{align*}")
        try:
            made = convert(latex, display="block" if found[2] == "[" else "inline")
        except Exception as error:  # the converter has no class for its errors
            _log.warning("%s: equation %r: %s", page, latex, error or type(error).__name__)
            return found[0]
        if unknown := re.search(r"\\[a-zA-Z]+|(?<=>)&(?=<)", made):
            _log.warning("%s: equation %r: %s cannot be set", page, latex, unknown[0])
        return made

    return _EQUATION.sub(mathml, content)


def on_post_page(output: str, page: Any, **_: object) -> str:
    """``output`` with the script that searches on the disk, from the site itself."""
    return output.replace(_ELSEWHERE, get_relative_url(_HERE, page.url))


def on_post_template(output_content: str, **_: object) -> str:
    """As `on_post_page`, for the page that says that there is none."""
    return output_content.replace(_ELSEWHERE, _HERE)
