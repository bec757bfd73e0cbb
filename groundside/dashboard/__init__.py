"""The live dashboard in Rerun: the swarm in space, its graph, its curves, its events."""

from ftcc.groundside.dashboard.dashboard import Dashboard
from ftcc.groundside.dashboard.subject import Subject

__all__ = ["Dashboard", "Subject"]
