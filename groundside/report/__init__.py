"""What a run showed, on the terminal and as JSON; a page with figures, see `report`, which loads matplotlib."""

from ftcc.groundside.report.terminal import (
    as_json,
    claims_of,
    claims_table,
    show,
    show_claims,
    show_verdict,
    summary,
)

__all__ = ["as_json", "claims_of", "claims_table", "show", "show_claims", "show_verdict", "summary"]
