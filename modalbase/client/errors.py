"""What stops a command, in one line, and the exit code that a script sees."""

from __future__ import annotations

from enum import IntEnum


class Exit(IntEnum):
    """Exit codes of the client's commands."""

    REFUSED = 1  # the service said no; the message has its reason
    USAGE = 2  # the command line, a file of it or the environment is wrong; nothing was sent
    UNREACHABLE = 3  # nobody answers, or something else than modalbase
    FAILED = 4  # a job or an import ran and did not succeed


class ClientError(Exception):
    """A command that cannot go on."""

    def __init__(self, message: str, code: Exit = Exit.REFUSED) -> None:
        super().__init__(message)
        self.code = code
