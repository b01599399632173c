"""Files of some folders that rest: nobody writes them any more."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatch
from pathlib import Path

UNFINISHED = (".part", ".partial", ".tmp", ".temp", ".crdownload", ".filepart", "~")
"""Ends of names that programs give a file until it is whole, when they rename it."""


@dataclass(frozen=True)
class FileState:
    """A file as it was looked at."""

    path: Path
    size: int
    modified_ns: int

    @classmethod
    def of(cls, path: Path) -> FileState:
        """A file as it is now.

        Raises:
            OSError: it is gone, or cannot be looked at.
        """
        about = path.stat()
        return cls(path, about.st_size, about.st_mtime_ns)


@dataclass
class Folders:
    """Looks at folders again and again. Sizes are polled, since shares of a network say nothing of
    changes.

    Attributes:
        folders: where files appear; folders below them are not looked at.
        patterns: of names, such as `*.npz`; a file of any of them counts.
        rest_s: seconds for which size and time of a file must have stayed to count as whole; 0
            where files arrive by rename.
        clock: in seconds.
        unreadable: folders that could not be read at the last look, with the reason.
    """

    folders: Sequence[Path]
    patterns: Sequence[str]
    rest_s: float
    clock: Callable[[], float] = time.monotonic
    unreadable: dict[Path, str] = field(default_factory=dict)
    _seen: dict[Path, tuple[FileState, float]] = field(default_factory=dict)

    def look(self) -> list[FileState]:
        """The files that rest, the oldest first; empty files are still to be written."""
        now, there = self.clock(), dict[Path, FileState]()
        self.unreadable = {}
        for folder in self.folders:
            try:
                there |= {each.path: each for each in self._files(folder)}
            except OSError as error:
                self.unreadable[folder] = error.strerror or str(error)
        # what lies in a folder that cannot be read now goes on resting
        self._seen = {
            path: known
            for path, known in self._seen.items()
            if path in there or path.parent in self.unreadable
        }
        for path, state in there.items():
            if path not in self._seen or self._seen[path][0] != state:
                self._seen[path] = state, now
        rest = [state for state in there.values() if now - self._seen[state.path][1] >= self.rest_s]
        return sorted(rest, key=lambda state: (state.modified_ns, state.path))

    def _files(self, folder: Path) -> Iterator[FileState]:
        with os.scandir(folder) as entries:
            for entry in entries:
                hidden = entry.name.startswith(".") or entry.name.lower().endswith(UNFINISHED)
                named = any(fnmatch(entry.name, pattern) for pattern in self.patterns)
                if hidden or not named or not entry.is_file():
                    continue
                try:
                    state = FileState.of(Path(entry.path))
                except FileNotFoundError:
                    continue
                if state.size:
                    yield state
