"""The command `modalbase` as a person starts it, and which of its processes still live."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from io import BytesIO, TextIOWrapper
from pathlib import Path
from signal import SIGTERM, getsignal, signal
from typing import IO
from unittest.mock import patch

import httpx
import psutil

from tests.support.places import ROOT
from tests.support.waiting import PATIENCE, until

COMMAND = Path(sys.executable).with_name("modalbase")


def environment(**more: str) -> dict[str, str]:
    clean = {name: value for name, value in os.environ.items() if not name.startswith("MODALBASE_")}
    return clean | {"MODALBASE_LOG_LEVEL": "warning"} | more


def modalbase(*words: str, cwd: Path | None = None, **env: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(COMMAND), *words],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
        env=environment(**env),
        cwd=cwd,
    )


def run_as_typed(command: str | list[str], cwd: Path, given: str = "", **env: str) -> str:
    """What a line of a shell, or a command and its words, prints where `modalbase` is on the path;
    it must succeed.
    """
    around = environment(**env)
    around["PATH"] = f"{COMMAND.parent}:{around['PATH']}"
    done = subprocess.run(
        command,
        shell=isinstance(command, str),
        cwd=cwd,
        env=around,
        input=given,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert done.returncode == 0, f"{command}: {done.stdout} {done.stderr}"
    return done.stdout


def modalbase_here(
    *words: object, cwd: Path | None = None, code: int | None = None, **env: str
) -> subprocess.CompletedProcess[str]:
    """What a command says that starts no process: run in this one, as each process of its own
    imports for a second.

    Args:
        words: of the command line.
        cwd: its folder.
        code: that it must end with; None where the caller looks.
        env: beside an environment that says nothing of a service.
    """
    from service.app.cli import main

    line, ended = list(map(str, words)), 0
    out, err = (TextIOWrapper(BytesIO(), encoding="utf-8", write_through=True) for _ in range(2))
    before, hook, handler = os.getcwd(), sys.excepthook, getsignal(SIGTERM)
    try:
        os.chdir(cwd or before)
        with (
            patch.dict(os.environ, environment(**env), clear=True),
            patch.object(sys, "argv", ["modalbase", *line]),
            redirect_stdout(out),
            redirect_stderr(err),
        ):
            main()
    except SystemExit as end:
        ended = end.code if isinstance(end.code, int) else int(end.code is not None)
    finally:
        os.chdir(before)
        sys.excepthook = hook
        signal(SIGTERM, handler)
    shown, errors = (stream.buffer.getvalue().decode() for stream in (out, err))
    assert code in (None, ended), f"{ended}: {shown} {errors}"
    return subprocess.CompletedProcess(line, ended, shown, errors)


_ONE_AFTER_THE_OTHER = """
import json, sys
from tests.support.command import modalbase_here
ended = [modalbase_here(*words, **env) for words, env in json.load(sys.stdin)]
print(json.dumps([(one.args, one.returncode, one.stdout, one.stderr) for one in ended]))
"""


def refusals(*lines: tuple[list[str], dict[str, str]]) -> list[subprocess.CompletedProcess[str]]:
    """What commands say that would run for long and must not start: all in one process, which ends
    if one starts after all.

    Args:
        lines: words of each command, and its environment.
    """
    ended = subprocess.run(
        [sys.executable, "-c", _ONE_AFTER_THE_OTHER],
        input=json.dumps(lines),
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
        cwd=ROOT,
    )
    assert ended.returncode == 0, ended.stderr
    return [subprocess.CompletedProcess(*one) for one in json.loads(ended.stdout)]


@contextmanager
def up(
    data: Path | None, *, cwd: Path | None = None, stderr: int | IO[str] | None = None, **env: str
) -> Iterator[tuple[subprocess.Popen[str], str, str]]:
    """A running `modalbase up`: process, URL, and the first key where it printed one."""
    words = ["up", "--port", "0", *([] if data is None else ["--data", str(data)])]
    process = subprocess.Popen(
        [str(COMMAND), *words],
        stdout=subprocess.PIPE,
        stderr=stderr,
        text=True,
        env=environment(**env),
        cwd=cwd,
    )
    try:
        said = ""
        while "API key" not in said:  # its last line
            line = process.stdout.readline()
            assert line, f"it ended: {said}"
            said += line
        url = re.findall(r"http://\S+/api/v1", said)[0]
        yield process, url, next(iter(re.findall(r"mb_\w+_\S+", said)), "")
    finally:
        process.terminate()
        process.wait(PATIENCE)
        process.stdout.close()


def living(data: Path) -> list[str]:
    """Processes that have to do with a data folder, by their command line or environment."""
    found = []
    for process in psutil.process_iter(["cmdline", "status", "pid"]):
        try:
            around = process.environ()
            words = " ".join(
                [
                    *(process.info["cmdline"] or []),
                    *map(str, map(around.get, ("MODALBASE_DATA", "PGDATA"))),
                ]
            )
        except (psutil.AccessDenied, psutil.NoSuchProcess):
            words = " ".join(process.info["cmdline"] or [])
        if str(data) in words and process.info["status"] != psutil.STATUS_ZOMBIE:
            found.append(words)
    return found


def wait_until_gone(data: Path) -> None:
    until(lambda: not living(data), "the end of all processes", lambda: living(data))


def status(url: str, key: str) -> int:
    return httpx.get(
        f"{url}/projects", headers={"Authorization": f"Bearer {key}"}, trust_env=False, timeout=60
    ).status_code
