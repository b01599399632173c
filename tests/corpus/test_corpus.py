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

REFUSED = dict(enumerate([*MEASUREMENTS, *BODIES, *SERIES_AND_COUPONS, *FILES]))
CORPUS: dict[str, Case] = {
    **{f"{number} {row[1]}": row for number, row in REFUSED.items()},
    **FRFS,
    **UPDATES,
}


@pytest.mark.parametrize("name", CORPUS)
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
