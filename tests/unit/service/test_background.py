"""A thread that goes round while a block runs."""

import threading

from service.jobs.background import Background

PATIENCE = 30.0


def test_it_goes_round_when_it_is_woken_and_ends_with_the_block() -> None:
    rounds = threading.Semaphore(0)

    def work() -> float:
        rounds.release()
        return 3600

    with Background("test", work) as background:
        for _ in range(3):
            assert rounds.acquire(timeout=PATIENCE)
            background.wake()
        assert rounds.acquire(timeout=PATIENCE)
    assert not [thread for thread in threading.enumerate() if thread.name == "test"]


def test_a_long_round_sees_that_the_block_ends() -> None:
    begun = threading.Event()

    def work() -> float:
        begun.set()
        assert background.ending.wait(PATIENCE)
        return 3600

    background = Background("test", work)
    with background:
        assert begun.wait(PATIENCE)
    assert background.ending.is_set()
