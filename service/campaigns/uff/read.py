"""A UFF file as a stream of contents and reports."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from service.campaigns.uff.content import Content, DatasetReport, Limits, UffError

DEFAULT_LIMITS = Limits()


def read_file(path: Path, limits: Limits = DEFAULT_LIMITS) -> Iterator[Content | DatasetReport]:
    """Content of a UFF file, dataset by dataset: all contents of one, then its `DatasetReport`.

    The framing of the whole file is checked before this returns; a dataset is parsed when it is asked for, so memory
    is bounded by the largest dataset. A dataset that is refused yields its report alone.

    Raises:
        UffError: the framing of the file is broken. It is raised by the call itself, before anything is yielded.
    """
    if path.stat().st_size == 0:
        raise UffError("the file is empty, expected a Universal File Format file")
    raise UffError("reading is not there yet")
