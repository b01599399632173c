"""The API in the process of the tests, for mutants: two processes need not load the project for each of them."""

from __future__ import annotations

import threading
from contextlib import ExitStack
from typing import Self

import uvicorn

from service.app.application import create_app
from service.app.supervisor import LocalService, listening_socket
from service.db.engine import make_engine
from service.settings import Settings
from service.web.server import PatientProtocol


class ServiceInside(LocalService):
    """A service without processes and without a worker, as much as the tests use of one."""

    def __init__(self, settings: Settings) -> None:
        """Prepare; `settings` name a database."""
        self.settings, self._stack = settings, ExitStack()

    def __enter__(self) -> Self:
        listener = self._stack.enter_context(listening_socket(self.settings.host, self.settings.port))
        self.url = f"http://{self.settings.host}:{listener.getsockname()[1]}"
        self._engine = make_engine(self.settings.database_url or "", pool_size=1)
        self._stack.callback(self._engine.dispose)
        app = create_app(self.settings)
        server = uvicorn.Server(
            uvicorn.Config(app, http=PatientProtocol, log_config=None, access_log=False, server_header=False)
        )
        runs = threading.Thread(target=server.run, kwargs={"sockets": [listener]}, daemon=True)
        runs.start()
        self._stack.callback(runs.join, 10)
        self._stack.callback(setattr, server, "should_exit", True)
        self._stack.callback(app.state.changes.close)
        return self
