"""The live dashboard in Rerun: the swarm in space, its graph, its curves, its events."""

from ftcc.groundside.dashboard.dashboard import Dashboard

__all__ = ["Dashboard"]
