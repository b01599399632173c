"""How a command ends: what goes wrong on purpose is one line on standard error, and SIGTERM
unwinds.
"""

from __future__ import annotations

import errno
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from types import FrameType
from typing import TYPE_CHECKING, NoReturn

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

AGAIN_SECONDS = 0.05  # after which a signal comes again whose exception went nowhere


def stop_with(message: str, code: int = 1) -> NoReturn:
    """End the command with one line on standard error."""
    sys.stderr.write(f"modalbase: {message}\n")
    sys.exit(code)


@contextmanager
def ending() -> Iterator[None]:
    """What a command does, within this, ends as commands do."""
    signal.signal(signal.SIGTERM, _leave)
    sys.unraisablehook = _leave_again
    try:
        yield
    except Exception as error:
        stop = error.__cause__
        # Python 3.11 wraps what is raised within `__set_name__`
        if isinstance(stop, SystemExit | KeyboardInterrupt):
            raise stop from None
        if (known := _known(error)) is None:
            raise
        stop_with(*known)


def _known(error: Exception) -> tuple[str, int] | None:
    """The line and the exit code of an error that is raised on purpose; None of any other."""
    from modalbase.client.errors import ClientError

    if isinstance(error, ClientError):
        return str(error), error.code
    if isinstance(error, OSError) and error.errno == errno.ENOSPC:
        _forget_output()
        return f"cannot write{f' {error.filename}' if error.filename else ''}: no space left", 2

    if find_spec("sqlalchemy") is None:  # modalbase alone, without its extra `server`
        lacks = isinstance(error, ModuleNotFoundError)
        return (
            ("this command runs the service: pip install 'modalbase[server]'", 2) if lacks else None
        )

    from psycopg import OperationalError as NoAnswer
    from sqlalchemy.exc import OperationalError

    from service.app.backup.archive import BackupError
    from service.app.supervisor import StartError
    from service.platform.db.engine import DatabaseUrlError
    from service.platform.db.opening import DataFolderError
    from service.platform.db.schema import SchemaError
    from service.platform.errors import ServiceError

    if isinstance(
        error,
        BackupError | DatabaseUrlError | DataFolderError | SchemaError | StartError | ServiceError,
    ):
        return str(error), 1
    if isinstance(error, OperationalError):
        return f"the database does not answer: {error.orig}", 1
    if isinstance(error, NoAnswer):
        return f"the database does not answer: {error}", 1
    return None


def _forget_output() -> None:
    """Keep the interpreter from writing the rest when it ends: it would report the full disk a
    second time.
    """
    with open(os.devnull, "wb") as nothing:
        os.dup2(nothing.fileno(), sys.stdout.fileno())


def _leave(_signal: int, _frame: FrameType | None) -> NoReturn:
    """SIGTERM unwinds as an error does, so that everything opened is closed."""
    sys.exit(0)


def _leave_again(went_nowhere: UnraisableHookArgs) -> None:
    """SIGTERM comes again where it met what takes no exceptions, such as a callback of the lock of a
    module that is being loaded: the command would never end.
    """
    if not issubclass(went_nowhere.exc_type, SystemExit):
        sys.__unraisablehook__(went_nowhere)
        return
    again = threading.Timer(AGAIN_SECONDS, os.kill, (os.getpid(), signal.SIGTERM))
    again.daemon = True
    again.start()
