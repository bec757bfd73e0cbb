"""The environment variables by which the launcher tells the fork server what `preload` shall load.

They stand apart from both: whoever imports `preload` loads all that flies, and the fork server nothing of the launcher.
"""

from __future__ import annotations

__all__ = ["ACTIVE_VARIABLE", "PLANT_VARIABLE", "SCHEME_VARIABLE"]

SCHEME_VARIABLE = "FTCC_PRELOAD_SCHEME"
PLANT_VARIABLE = "FTCC_PRELOAD_PLANT"
ACTIVE_VARIABLE = "FTCC_PRELOAD_ACTIVE"
"""1: with active fault tolerance, 0: without."""
