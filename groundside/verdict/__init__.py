"""How a flight went, in a few lines and one word."""

from ftcc.groundside.verdict.judge import judge
from ftcc.groundside.verdict.verdict import AS_IT_SHOULD, FAILED, FILE, REMARKS, Verdict, size

__all__ = ["AS_IT_SHOULD", "FAILED", "FILE", "REMARKS", "Verdict", "judge", "size"]
