"""Reading what a client sent in a child process of the API, before the request is answered.

A parser that meets a hostile file must not take the API's memory or time. It runs where jobs run,
in a child with a limit on both; the request gives its slot back meanwhile, so that a few large
files do not keep everybody else waiting.
"""

import threading
from collections.abc import Callable, Coroutine, Iterator
from functools import partial
from typing import Any, ParamSpec, TypeVar

from anyio import CapacityLimiter, to_thread

from fecore.errors import FecoreError
from service.platform.errors import PayloadTooLarge, ServiceError
from service.platform.queue.child import Failure, Item, Order
from service.platform.queue.kinds import CORE_LIBRARIES, Reporter
from service.platform.queue.process import Child, ChildEnded, preload

MEMORY_BYTES = 1024 * 1024 * 1024
SECONDS = 60.0
AT_ONCE = 2

Given = ParamSpec("Given")
Made = TypeVar("Made")
_threads = CapacityLimiter(AT_ONCE)
_modules: set[str] = set(CORE_LIBRARIES)
"""Of all that is read, which are loaded before children are forked: to load scipy or schemas in each
child takes it 0.5 s.
"""


def in_subprocess(function: Callable[Given, Made]) -> Callable[Given, Coroutine[Any, Any, Made]]:
    """A function at the top of a module, whose arguments and result pickle, as one that runs in a
    child process.

    It raises what the function raised (ServiceError, FecoreError), and PayloadTooLarge where it
    takes more memory or time than the reading of a body may.
    """
    _modules.add(function.__module__)

    async def read(*arguments: Given.args, **named: Given.kwargs) -> Made:
        call = partial(function, *arguments, **named)
        made: Made = await to_thread.run_sync(_read, call, limiter=_threads)
        return made

    return read


def _read(call: Callable[[], Any]) -> Any:
    preload(_modules, threads=1)
    # a request waits for it
    order = Order(_call, call, None, MEMORY_BYTES, niceness=0)
    try:
        child = Child(order)
    except ChildEnded:  # the server that it is forked from was killed; another one is started
        preload(_modules, threads=1)
        child = Child(order)
    late = Failure(
        "time",
        "TimeLimit",
        f"reading the body takes longer than the {SECONDS:g} s that it may take",
    )
    timer = threading.Timer(SECONDS, child.kill, [late])
    timer.start()
    try:
        (result,) = [message.value for message in child.messages() if isinstance(message, Item)]
    except ChildEnded as ended:
        if ended.failure.reason == "internal":
            raise RuntimeError(ended.failure.trace or ended.failure.detail) from None
        raise PayloadTooLarge(f"the body cannot be read here: {ended.failure.detail}") from None
    finally:
        timer.cancel()
        child.close()
    if isinstance(result, ServiceError | FecoreError):
        raise result
    return result


def _call(call: Callable[[], Any], _: Reporter) -> Iterator[Any]:
    """In the child: the result, or the error that says what is wrong with the body."""
    try:
        yield call()
    except (ServiceError, FecoreError) as error:
        yield error
