"""What a run showed: claims on the terminal and as JSON, figures."""

from ftcc.groundside.report.terminal import as_json, claims_of, claims_table, draw, show, show_claims, summary

__all__ = ["as_json", "claims_of", "claims_table", "draw", "show", "show_claims", "summary"]
