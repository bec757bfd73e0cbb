"""Lay out the views: the swarm on the left, below it the graph, the table and the events; the curves on the right."""

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

__all__ = ["blueprint"]

_BESIDE = 4
"""Largest number of plots in one column; more plots take two columns."""


def blueprint(
    scene: Scene,
    attitudes: Attitudes | None,
    plots: Plots,
    table: Table,
    pace: PaceCurve | None,
    diagnosis: DiagnosisPanel | None = None,
) -> rrb.Blueprint:
    """Return the layout for the viewer and the recording."""
    swarm = scene.view()
    groups = plots.views()
    tracking = _stack(groups.pop("Tracking"), "Tracking")
    above = tracking if diagnosis is None else rrb.Tabs(tracking, diagnosis.view())
    tabs = [_stack(views, name) for name, views in groups.items()]
    tabs += [_stack([pace.view()], "Pace")] if pace is not None else []
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(
                swarm if attitudes is None else rrb.Tabs(attitudes.view(), swarm),
                rrb.Horizontal(
                    scene.links.view(),
                    rrb.Vertical(table.view(), log_view(), row_shares=[3, 2]),
                    column_shares=[2, 3],
                ),
                row_shares=[6, 5],
            ),
            rrb.Vertical(above, rrb.Tabs(*tabs), row_shares=[3, 2]),
            column_shares=[3, 2],
        ),
        rrb.TopPanel(state=rrb.PanelState.Collapsed),
        rrb.BlueprintPanel(state=rrb.PanelState.Hidden),
        rrb.SelectionPanel(state=rrb.PanelState.Hidden),
        rrb.TimePanel(state=rrb.PanelState.Collapsed, timeline="t", play_state="following"),
        auto_layout=False,
        auto_views=False,
    )


def _stack(views: list[rrb.View], name: str) -> rrb.Container:
    """Stack plots in one column, or in two if they are many."""
    return rrb.Vertical(*views, name=name) if len(views) <= _BESIDE else rrb.Grid(*views, grid_columns=2, name=name)
