"""Studies: one scenario flown many times, over values of its settings and seeds of its chance."""

from ftcc.groundside.study.figure import draw
from ftcc.groundside.study.flights import Outcome, fly_all
from ftcc.groundside.study.plan import Study, StudyError, Trial, plan_study
from ftcc.groundside.study.results import summary, table, write

__all__ = ["Outcome", "Study", "StudyError", "Trial", "draw", "fly_all", "plan_study", "summary", "table", "write"]
