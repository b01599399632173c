"""A PostgreSQL that listens on TCP and asks for a password, as a server on another machine does."""

import os
import pwd
import shutil
import socket
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from service.platform.db.postgres import ACCOUNT, programs


@contextmanager
def password_server(folder: Path, user: str, password: str, database: str) -> Iterator[int]:
    """Port on 127.0.0.1 of a server whose superuser has this name and password, with an empty
    database.
    """
    account = ACCOUNT if os.geteuid() == 0 else None
    folder.mkdir(mode=0o755)
    (folder / "password").write_text(password)
    if account is not None:
        os.chown(folder, *pwd.getpwnam(account)[2:4])
        os.chown(folder / "password", *pwd.getpwnam(account)[2:4])
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]

    def run(*words: str) -> None:
        command = [str(programs() / words[0]), *words[1:]]
        subprocess.run(
            command,
            user=account,
            cwd=folder,
            check=True,
            stdout=subprocess.DEVNULL,
            env={"LC_ALL": "C"},
        )

    data = str(folder / "data")
    run(
        "initdb",
        "-A",
        "scram-sha-256",
        "-E",
        "UTF8",
        "--no-locale",
        "-U",
        user,
        f"--pwfile={folder / 'password'}",
        "-D",
        data,
    )
    run(
        "pg_ctl",
        "-w",
        "-D",
        data,
        "-l",
        str(folder / "log"),
        "-o",
        f"-h 127.0.0.1 -p {port} -k {folder}",
        "start",
    )
    try:
        uri = f"postgresql://{user}:{password}@127.0.0.1:{port}/postgres"
        subprocess.run(
            [str(programs() / "psql"), uri, "-qc", f"CREATE DATABASE {database}"], check=True
        )
        yield port
    finally:
        run("pg_ctl", "-w", "-D", data, "-m", "fast", "stop")
        shutil.rmtree(folder)
