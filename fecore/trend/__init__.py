"""Trends: whether a structure has changed, judged campaign after campaign with a stated false-alarm rate.

`assess` is the one entry point: series of dated estimates and a `Watch` in, an `Assessment` out. The rooms in the order in
which data flows: series, regression, charts, autocorrelation, baseline, run_length, timeline (states), change, rates,
assessment, document.
"""

from fecore.trend.assessment import Assessment, ParameterTrend, assess
from fecore.trend.autocorrelation import Autocorrelation
from fecore.trend.baseline import Baseline, Scores, fit_baseline, score
from fecore.trend.change import ChangePoint, change_point
from fecore.trend.charts import Chart, Limits
from fecore.trend.rates import Rate, rate, rate_since_onset
from fecore.trend.run_length import alarm_probability, average_run_length, control_limits
from fecore.trend.series import Series, in_time_order
from fecore.trend.states import Condition, Event, State, step, worst
from fecore.trend.timeline import Acknowledgement, Moment
from fecore.trend.watch import Direction, Watch

__all__ = [
    "Acknowledgement",
    "Assessment",
    "Autocorrelation",
    "Baseline",
    "ChangePoint",
    "Chart",
    "Condition",
    "Direction",
    "Event",
    "Limits",
    "Moment",
    "ParameterTrend",
    "Rate",
    "Scores",
    "Series",
    "State",
    "Watch",
    "alarm_probability",
    "assess",
    "average_run_length",
    "change_point",
    "control_limits",
    "fit_baseline",
    "in_time_order",
    "rate",
    "rate_since_onset",
    "score",
    "step",
    "worst",
]
