"""Import matplotlib for figures in files: without a display, and with a cache folder that is always writable."""

from __future__ import annotations

from ftcc.link.folders import matplotlib_folder

matplotlib_folder()

import matplotlib  # noqa: E402  (must see MPLCONFIGDIR)

matplotlib.use("Agg")

from matplotlib import pyplot as plt  # noqa: E402
from matplotlib.lines import Line2D  # noqa: E402

__all__ = ["Line2D", "plt"]
