"""The watch: files that rest are sent, each once, and what becomes of them is reported."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from modalbase.client.errors import ClientError, Exit
from modalbase.watch.statements import NotStatedYetError, StatementError

if TYPE_CHECKING:
    from modalbase.objects.jobs import Import
    from modalbase.objects.projects import Structure
    from modalbase.watch.folders import FileState, Folders
    from modalbase.watch.statements import Statements

AT_ONCE = 100
"""Files whose digests the service is asked for at a time."""
BLOCK_BYTES = 1 << 20
FIRST_PAUSE_S, LONGEST_PAUSE_S = 1.0, 300.0
TRANSIENT = (408, 425, 429, 502, 503, 504)
"""Statuses of HTTP after which the same request may succeed later."""
QUOTA = "MODALBASE_PROJECT_QUOTA_BYTES"  # what a refusal names where the project has no room
STOPS = (401, 403, 404)
"""Statuses that concern the key, the role or the structure, and so every file."""

Answer = TypeVar("Answer")
Outcome = Literal["sent", "read", "known", "failed", "waits", "changed", "outage"]


@dataclass(frozen=True)
class Happening:
    """What became of a file, or of the way to the service."""

    file: str
    outcome: Outcome
    detail: str = ""
    import_id: str | None = None
    campaign_id: str | None = None


@dataclass
class Watch:
    """Sends files of folders to a structure, each as a campaign of its own.

    Attributes:
        structure: that is measured.
        folders: where files appear.
        statements: what is stated of each.
        report: called with what became of a file.
        again: send those once more that the service could not read, into their campaigns.
    """

    structure: Structure
    folders: Folders
    statements: Statements
    report: Callable[[Happening], None]
    again: bool = False
    counts: Counter[Outcome] = field(default_factory=Counter)
    _handled: dict[Path, FileState] = field(default_factory=dict)
    _under_way: dict[str, tuple[Path, Import]] = field(default_factory=dict)
    _digests: dict[Path, tuple[FileState, str]] = field(default_factory=dict)
    _waiting: dict[Path, str] = field(default_factory=dict)
    _unreadable: dict[Path, str] = field(default_factory=dict)

    @property
    def waiting(self) -> int:
        """How many files wait for their covariates."""
        return len(self._waiting)

    def run(self, every_s: float, stop: Event) -> None:
        """Look again and again until `stop` is set; outages are waited for, each longer than the
        last, up to five minutes.

        Raises:
            ClientError: the key, the role or the structure is refused.
        """
        while not stop.is_set():
            through_outages(
                lambda: self.round(stop), stop, lambda text: self._note("", "outage", text)
            )
            stop.wait(every_s)

    def run_once(self, stop: Event) -> None:
        """Send what is there now, and wait until it is read.

        Raises:
            ClientError: the service does not answer, or refuses the key, the role or the structure.
        """
        self.folders.look()
        stop.wait(self.folders.rest_s)
        self.round(stop)
        while self._under_way and not stop.is_set():
            for _, job in list(self._under_way.values()):
                job.wait()
            self.follow()

    def round(self, stop: Event) -> None:
        """One look: what rests and was not handled as it is now is sent, what was sent is
        followed.

        Raises:
            ClientError: as `run_once`.
        """
        self.follow()
        rest = self.folders.look()
        self._note_unreadable()
        covariates = self.statements.covariates
        names = frozenset(state.path.name for state in rest)
        new = [
            state
            for state in rest
            if self._handled.get(state.path) != state
            and not (covariates is not None and covariates.is_beside(state.path, names))
        ]
        for first in range(0, len(new), AT_ONCE):
            self._send_new(new[first : first + AT_ONCE], stop)

    def _send_new(self, states: Sequence[FileState], stop: Event) -> None:
        digests = {state: digest for state in states if (digest := self._digest(state))}
        unsent = [digest for state, digest in digests.items() if state.path not in self._waiting]
        known = self._known(unsent)
        for state, digest in digests.items():
            if stop.is_set():
                return
            if digest in known:
                self._meet(state, known[digest])
            else:
                self._send(state, digest)

    def _digest(self, state: FileState) -> str | None:
        """SHA-256 of a file; None of one that cannot be read. That of a file that waits is kept."""
        before, own = self._digests.pop(state.path, (None, ""))
        if before == state:
            self._digests[state.path] = state, own
            return own
        digest = hashlib.sha256()
        try:
            with state.path.open("rb") as file:
                while block := file.read(BLOCK_BYTES):
                    digest.update(block)
        except FileNotFoundError:
            return None
        except OSError as error:
            self._fail(state, f"cannot be read: {error.strerror or error}")
            return None
        self._digests[state.path] = state, digest.hexdigest()
        return digest.hexdigest()

    def _known(self, digests: list[str]) -> dict[str, Import]:
        """What the service has of these bytes: what was read or will be before what failed."""
        if not digests:
            return {}
        both = [
            one
            for deleted in (True, False)
            for one in self.structure.imports(digests, deleted=deleted)
        ]
        both.sort(key=lambda one: one.fields["status"] not in ("failed", "cancelled"))
        return {one.fields["sha256"]: one for one in both}

    def _meet(self, state: FileState, known: Import) -> None:
        """A file that the service has."""
        path, failed = state.path, known.fields["status"] in ("failed", "cancelled")
        if failed and self.again:
            campaign = self.structure.campaign(known.fields["campaign_id"])
            how = {name: value for name, value in self.statements.how.items() if value is not None}
            self._sent(state, campaign.import_file(path, wait=False, **how))
        elif failed:
            self._fail(state, f"was sent before: {known.summary()}", known)
        elif known.ended:
            self._done(state, "known", f"the service has it as campaign {known.campaign_id}", known)
        else:
            self._sent(state, known)

    def _send(self, state: FileState, digest: str) -> None:
        path = state.path
        try:
            stated = dict(self.statements.of(path))
        except NotStatedYetError as error:
            if self._waiting.get(path) != str(error):
                self._waiting[path] = str(error)
                self._note(path.name, "waits", str(error))
            return
        except (StatementError, OSError) as error:
            self._fail(state, str(error))
            return
        try:
            name, boundary = str(stated.pop("name")), str(stated.pop("boundary"))
            how = dict(self.statements.how)
            mapping: Any = how.pop("mapping", None)
            job = self.structure.add_recording(
                path, boundary, name=name, mapping=mapping, wait=False, how=how, **stated
            )
        except (ClientError, OSError) as error:
            if not _unchanged(state):
                self._note(path.name, "changed", "it changed while it was sent; it is sent anew")
            elif not isinstance(error, ClientError) or not _of_all(error):
                self._fail(state, str(error))
            else:
                raise
            return
        if job.fields["sha256"] != digest:
            self._note(path.name, "changed", "it changed before it was sent")
        if job.already_imported:
            self._meet(state, job)
        else:
            self._sent(state, job)

    def _sent(self, state: FileState, job: Import) -> None:
        self._under_way[job.fields["id"]] = (state.path, job)
        self._done(state, "sent", f"as campaign {state.path.stem}", job)

    def follow(self) -> None:
        """Report what was read of what was sent, and what could not be.

        Raises:
            ClientError: the service does not answer.
        """
        for key, (path, job) in list(self._under_way.items()):
            try:
                job.refresh()
            except ClientError as error:
                if error.status != STOPS[-1]:
                    raise
                del self._under_way[key]
                self._note(path.name, "failed", "it was removed before it was read", job)
                continue
            if job.ended:
                del self._under_way[key]
                self._note(path.name, "read" if job.succeeded else "failed", _became(job), job)

    def _fail(self, state: FileState, why: str, job: Import | None = None) -> None:
        self._done(state, "failed", why, job)

    def _done(
        self, state: FileState, outcome: Outcome, detail: str, job: Import | None = None
    ) -> None:
        self._handled[state.path] = state
        self._waiting.pop(state.path, None)
        self._digests.pop(state.path, None)
        self._note(state.path.name, outcome, detail, job)

    def _note(self, file: str, outcome: Outcome, detail: str, job: Import | None = None) -> None:
        self.counts[outcome] += 1
        ids = {} if job is None else {"import_id": job.id, "campaign_id": job.campaign_id}
        self.report(Happening(file, outcome, detail, **ids))

    def _note_unreadable(self) -> None:
        for folder, why in self.folders.unreadable.items():
            if self._unreadable.get(folder) != why:
                self._note(str(folder), "outage", f"the folder cannot be read: {why}")
        self._unreadable = dict(self.folders.unreadable)


def through_outages(
    ask: Callable[[], Answer], stop: Event, note: Callable[[str], object]
) -> Answer | None:
    """What the service answers once it does: outages are waited for, each longer than the last, up
    to five minutes; None where `stop` was set before.

    Args:
        ask: asks the service.
        stop: ends the waiting.
        note: called with what is wrong and how long is waited.

    Raises:
        ClientError: the service refuses.
    """
    pause = FIRST_PAUSE_S
    while not stop.is_set():
        try:
            return ask()
        except ClientError as error:
            if not _is_outage(error):
                raise
            note(f"{error}; tries again in {pause:g} s")
        stop.wait(pause)
        pause = min(2 * pause, LONGEST_PAUSE_S)
    return None


def _is_outage(error: ClientError) -> bool:
    no_room = error.status == 413 and QUOTA in str(error)
    return error.status in TRANSIENT or error.code == Exit.UNREACHABLE or no_room


def _of_all(error: ClientError) -> bool:
    """Whether what was refused concerns every file, or nobody answered."""
    return error.status in STOPS or _is_outage(error)


def _unchanged(state: FileState) -> bool:
    try:
        return type(state).of(state.path) == state
    except OSError:
        return False


def _became(job: Import) -> str:
    """What an import brought, in a line, or why nothing."""
    if not job.succeeded:
        return job.summary()
    counts = job.fields["counts"] or {}
    brought = ", ".join(
        f"{count} {name.replace('_', ' ')}" for name, count in counts.items() if count
    )
    return "; ".join([brought, *job.fields["warnings"]])


def events_of(counts: Counter[Outcome]) -> Iterator[str]:
    """The summary: how many files there were of each outcome."""
    yield from (f"{counts[name]} {name}" for name in ("sent", "read", "known", "failed"))
