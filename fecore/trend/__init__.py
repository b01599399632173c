"""Trends: whether a structure has changed, judged campaign after campaign with a stated false-alarm
rate.

`assess` is the entry point of monitors: series of dated estimates and a `Watch` in, an `Assessment`
out. The rooms in the order in which data flows: series, charts, autocorrelation, baseline, states,
change, common_factor, assessment, explanations, patterns, document. `tracking` says by `track_states`
which modes of several runs are the same, and `mode_series` makes series of them.
"""

from fecore.trend.assessment import Assessment, Before, ParameterTrend, Window, assess
from fecore.trend.autocorrelation import Autocorrelation
from fecore.trend.baseline import Baseline, Scores, fit_baseline, score
from fecore.trend.change import ChangePoint, Line, Rate, change_point, line, rate, rate_since_onset
from fecore.trend.charts import Chart, Limits, alarm_probability, average_run_length, control_limits
from fecore.trend.mode_series import ModeSeries, ModesOfRun, mode_series
from fecore.trend.series import Direction, Series, Watch, in_time_order
from fecore.trend.states import Acknowledgement, Condition, Event, Moment, State, step, worst
from fecore.trend.tracking import Following, Shape, TrackedMode, Tracks, follow, track

__all__ = [
    "Acknowledgement", "Assessment", "Autocorrelation", "Baseline", "Before", "ChangePoint", "Chart",
    "Condition", "Direction", "Event", "Following", "Limits", "Line", "ModeSeries", "ModesOfRun", "Moment",
    "ParameterTrend", "Rate", "Scores", "Series", "Shape", "State", "TrackedMode", "Tracks", "Watch", "Window",
    "alarm_probability", "assess", "average_run_length", "change_point", "control_limits", "fit_baseline",
    "follow", "in_time_order", "line", "mode_series", "rate", "rate_since_onset", "score", "step", "track",
    "worst",
]  # fmt: skip
