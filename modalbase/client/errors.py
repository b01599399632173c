"""What stops a call or a command, in one line, and the exit code that a script sees."""

from collections.abc import Mapping
from enum import IntEnum
from typing import Any


class Exit(IntEnum):
    """Exit codes of the commands that talk to a service."""

    REFUSED = 1  # the service said no; the message has its reason
    USAGE = 2  # the command line, a file of it or the environment is wrong; nothing was sent
    UNREACHABLE = 3  # nobody answers, or something else than modalbase
    FAILED = 4  # a job or an import ran and did not succeed


class ClientError(Exception):
    """A call or a command that cannot go on; its text is the service's own words where the service
    refused.

    Attributes:
        code: the exit code of a command that ends so.
        status: of HTTP; None where nothing answered.
        problem: the problem document (RFC 9457) of a refusal: `detail`, `errors` with a JSON
            pointer each, `request_id`.
    """

    def __init__(
        self,
        message: str,
        code: Exit = Exit.REFUSED,
        *,
        status: int | None = None,
        problem: Mapping[str, Any] | None = None,
    ) -> None:
        super().__init__(message)
        self.code = code
        self.status = status
        self.problem: Mapping[str, Any] = {} if problem is None else problem


class JobFailed(ClientError):
    """A job ended without success; the text is the reason that it states.

    Attributes:
        job: its last state as the service describes it.
    """

    def __init__(self, message: str, job: Mapping[str, Any]) -> None:
        super().__init__(message, Exit.FAILED)
        self.job = job
