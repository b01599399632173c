"""The API in the process of the tests, for mutants: two processes need not load the project for each of them."""

from __future__ import annotations

import threading
from contextlib import ExitStack
from typing import Any, Self

import uvicorn

from service.access.keys import create_key, user_named
from service.app import create_app
from service.db.engine import make_engine, make_sessions
from service.settings import Settings
from service.supervisor import listening_socket
from service.web.server import PatientProtocol


class ServiceInside:
    """What the tests use of `service.supervisor.LocalService`, without a worker."""

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

    def __exit__(self, *_: Any) -> None:
        self._stack.close()

    def new_key(self, name: str, *, administrator: bool = False) -> str:
        """A new API key of the user of that name, who is made when absent."""
        with make_sessions(self._engine).begin() as session:
            user = user_named(session, name)
            user.administrator |= administrator
            return create_key(session, user, name)[1]
