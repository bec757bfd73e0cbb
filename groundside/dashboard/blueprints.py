"""Lay out the views in two pages, each with the whole flight as a strip.

*Flight*: the swarm on the left, below it the graph, the table or the events; the curves on the right. *Ground station*:
the swarm, large, and the table and the events beside it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import rerun.blueprint as rrb

from ftcc.groundside.dashboard.table import log_view

if TYPE_CHECKING:
    from ftcc.groundside.dashboard.attitudes import Attitudes
    from ftcc.groundside.dashboard.diagnosis import DiagnosisPanel
    from ftcc.groundside.dashboard.pace import PaceCurve
    from ftcc.groundside.dashboard.plots import Plots
    from ftcc.groundside.dashboard.scene import Scene
    from ftcc.groundside.dashboard.table import Table
    from ftcc.groundside.dashboard.timeline import Timeline

__all__ = ["blueprint"]

_BESIDE = 4
"""Largest number of plots in one column; more plots take two columns."""


def blueprint(
    scene: Scene,
    attitudes: Attitudes | None,
    plots: Plots,
    table: Table,
    timeline: Timeline,
    pace: PaceCurve | None,
    diagnosis: DiagnosisPanel | None = None,
) -> rrb.Blueprint:
    """Return the layout for the viewer and the recording."""
    groups = plots.views()
    tracking = _stack(groups.pop("Tracking"), "Tracking")
    above = tracking if diagnosis is None else rrb.Tabs(tracking, diagnosis.view())
    tabs = [_stack(views, name) for name, views in groups.items()]
    tabs += [_stack([pace.view()], "Pace")] if pace is not None else []
    flight = rrb.Horizontal(
        rrb.Vertical(
            _swarm(scene, attitudes),
            rrb.Horizontal(scene.links.view(), rrb.Tabs(table.view(), log_view()), column_shares=[2, 3]),
            timeline.view(),
            row_shares=[5, 4, 2.5],
        ),
        rrb.Vertical(above, rrb.Tabs(*tabs), row_shares=[3, 2]),
        column_shares=[3, 2],
        name="Flight",
    )
    ground = rrb.Vertical(
        rrb.Horizontal(
            _swarm(scene, attitudes), rrb.Vertical(table.view(), log_view(), row_shares=[3, 2]), column_shares=[5, 3]
        ),
        timeline.view(),
        row_shares=[4, 1],
        name="Ground station",
    )
    return rrb.Blueprint(
        rrb.Tabs(flight, ground),
        rrb.TopPanel(state=rrb.PanelState.Collapsed),
        rrb.BlueprintPanel(state=rrb.PanelState.Hidden),
        rrb.SelectionPanel(state=rrb.PanelState.Hidden),
        rrb.TimePanel(state=rrb.PanelState.Collapsed, timeline="t", play_state="following"),
        auto_layout=False,
        auto_views=False,
    )


def _swarm(scene: Scene, attitudes: Attitudes | None) -> rrb.View | rrb.Container:
    """Return the aircraft: side by side first where attitudes count, and from the side where altitudes do."""
    views = [attitudes.view()] if attitudes is not None else []
    views.append(scene.view())
    views += [scene.side_view()] if scene.is_longitudinal else []
    return views[0] if len(views) == 1 else rrb.Tabs(*views)


def _stack(views: list[rrb.View], name: str) -> rrb.Container:
    """Stack plots in one column, or in two if they are many."""
    return rrb.Vertical(*views, name=name) if len(views) <= _BESIDE else rrb.Grid(*views, grid_columns=2, name=name)
