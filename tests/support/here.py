"""An API in a thread of the test's own process: its routes, limits and database are real, and it
begins in a tenth of the time that a process takes. It has no worker and takes no signal.
"""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Thread

import structlog
from uvicorn import Config, Server

from service.app.application import create_app
from service.app.supervisor import LocalService, listening_socket
from service.platform.settings import Settings
from service.platform.web.middleware import PatientProtocol


@contextmanager
def served_here(settings: Settings) -> Iterator[LocalService]:
    """A service that answers within this; of its log, what is wrong is printed."""
    structlog.configure(wrapper_class=structlog.make_filtering_bound_logger(logging.WARNING))
    api = create_app(settings)
    server = Server(
        Config(api, http=PatientProtocol, log_config=None, access_log=False, server_header=False)
    )
    with listening_socket("127.0.0.1", 0) as listener:
        service = LocalService(settings, worker=False)
        service.url = f"http://127.0.0.1:{listener.getsockname()[1]}"
        thread = Thread(target=server.run, kwargs={"sockets": [listener]})
        thread.start()
        try:
            yield service
        finally:
            api.state.changes.close()  # streams of events have no other end
            server.should_exit = True
            thread.join()
            service.__exit__()
