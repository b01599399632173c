"""Every input of the corpus has its outcome."""

import pickle

import pytest

from fecore.errors import FecoreError, UpdatingError
from modalbase.formats.errors import FormatError
from tests.corpus.frfs import FRFS
from tests.corpus.outcomes import Case
from tests.corpus.refused_bodies import BODIES
from tests.corpus.refused_files import FILES
from tests.corpus.refused_measurements import MEASUREMENTS
from tests.corpus.refused_series import SERIES_AND_COUPONS
from tests.corpus.updates import UPDATES
from tests.support.lengths import long

REFUSED = dict(enumerate([*MEASUREMENTS, *BODIES, *SERIES_AND_COUPONS, *FILES]))
CORPUS: dict[str, Case] = {
    **{f"{number} {row[1]}": row for number, row in REFUSED.items()},
    **FRFS,
    **UPDATES,
}


IN_LONG = {
    *("another clamped beam", "a mistyped mode"),  # in short: stated as free, another free beam
    *("a sure prior", "in g", "one mode, two coefficients"),
    # in short: above its prior; turned and not calibrated; one mode, heights wrong
    *("a start of negative damping", "a negative variance"),  # in short: a singular start
    "conjugates",  # in short: bridge, conjugated
    *("open aeroplane", "a quadratic spring", "records that drift"),
    # in short: open plate, a mode at the sum of two, drift of the records
}
"""Whose cause has a cheaper input of the same kind, or the same numbers elsewhere."""


@pytest.mark.parametrize("name", [long(name) if name in IN_LONG else name for name in CORPUS])
def test_each_input_has_its_outcome(name: str) -> None:
    run, outcome = CORPUS[name]
    if callable(outcome):
        outcome(run())
        return
    with pytest.raises((FecoreError, FormatError)) as refused:
        run()
    assert str(refused.value).startswith(outcome)
    again = pickle.loads(pickle.dumps(refused.value))  # on the way from a worker
    assert (type(again), str(again)) == (type(refused.value), str(refused.value))


def test_the_best_iterate_comes_from_a_worker_too() -> None:
    failed = pickle.loads(pickle.dumps(UpdatingError("no rest", {"Ex": 1.0}, ((1.0,),))))
    assert (failed.message, failed.best, failed.history) == ("no rest", {"Ex": 1.0}, ((1.0,),))
