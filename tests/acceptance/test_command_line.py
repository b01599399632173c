"""The command line as a person meets it: what starts and what cannot, and from an empty database to
a figure.
"""

import json
import signal
import socket
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import httpx
import psutil
import pytest

from fecore import __version__
from service.app.supervisor import LocalService
from service.pages.example import paper
from tests.support.command import (
    COMMAND,
    environment,
    modalbase,
    modalbase_here,
    refusals,
    wait_until_gone,
)
from tests.support.lengths import long
from tests.support.rest import posted
from tests.support.waiting import PATIENCE, until

Run = Callable[..., "subprocess.CompletedProcess[str]"]
MODULI = "Ex=33.05,Ey=31.8,Gxy=5.73,Gxz=4.5,Gyz=4.5,nu_xy=0.15"


@pytest.fixture
def run(service: LocalService, api: httpx.Client, tmp_path: Path) -> Run:
    key = api.headers["authorization"].split()[1]

    def call(*words: object, code: int = 0, **more: str) -> subprocess.CompletedProcess[str]:
        around = {"MODALBASE_URL": service.url, "MODALBASE_API_KEY": key, "COLUMNS": "200", **more}
        return modalbase_here(*words, cwd=tmp_path, code=code, **around)

    return call


def test_from_an_empty_database_to_a_figure(run: Run, api: httpx.Client, tmp_path: Path) -> None:
    """Every command of the main job, in the order that each names the next."""
    (tmp_path / "beam.uff").write_bytes(paper.uff_file())
    assert "next: modalbase projects --new" in run("projects").stderr
    run("projects", "--new", "bridge deck")
    made = run(
        "structures", "--new", "beam", "--size", "500x40x10", "--density", 2012, "--moduli", MODULI
    )
    assert 'next: modalbase campaigns --new NAME --structure "beam"' in made.stderr
    structure = api.get(f"structures/{made.stdout.strip()}").json()
    assert structure["geometry"] == {"length_m": 0.5, "width_m": 0.04, "thickness_m": 0.01}
    assert structure["material"]["Gxy_Pa"] == pytest.approx(5.73e9)
    stated = (
        "--temperature",
        21.5,
        "--sensor-mass",
        1.8,
        "--sensor-point",
        3,
        "--boundary",
        "cantilever",
    )
    made = run("campaigns", "--new", "March", "--structure", "bridge deck/beam", *stated, "--json")
    campaign = json.loads(made.stdout)
    assert campaign["temperature_c"] == 21.5
    assert campaign["instruments"]["sensor_mass_kg"] == pytest.approx(0.0018)
    assert (
        'next: modalbase update "March" --wait'
        in run("import", "beam.uff", "--campaign", "March").stderr
    )
    modes = {"name": "Table 3", "modes": paper.MODES}
    posted(api, f"campaigns/{campaign['id']}/mode-sets", modes)
    assert "25.6" in run("modes", "March").stdout
    first = json.loads(run("modes", "March", "--json").stdout)
    hz = first["modes"][-1]["frequency_hz"]
    edited = json.loads(
        run("modes", "March", "--drop", f"{hz:.6g}", "--why", "too high", "--json").stdout
    )
    assert [mode["frequency_hz"] for mode in edited["modes"]] == [
        m["frequency_hz"] for m in first["modes"][:-1]
    ]
    assert edited["details"]["decisions"][0]["reason"] == "too high"
    run("modes", "March", "--mode-set", edited["id"], "--keep", f"{hz:.6g}", code=2)
    recipe = {"seed": 7, "damping_models": ["rayleigh"], "parameters": [{"name": "Ex"}]}
    (tmp_path / "recipe.json").write_text(json.dumps(recipe))
    words = ("--recipe", tmp_path / "recipe.json", "--mode-set", "latest", "--wait", "--json")
    document = json.loads(run("update", "latest", *words).stdout)
    assert document["provenance"]["recipe"]["seed"] == 7
    listed = json.loads(run("jobs", "--campaign", "March", "--json").stdout)
    assert run("jobs").stdout.count("March") == len(listed) == 1
    assert run("result", "--json").stdout == run("result", listed[0]["id"], "--json").stdout
    assert "MAC of measured" in run("figure", "list").stdout
    assert run("figure", "frf", "latest", "--out", "frf.pdf").stdout.strip() == "frf.pdf"
    assert (tmp_path / "frf.pdf").read_bytes().startswith(b"%PDF")
    run("export", "latest", "--what", "predicted", "--out", "predicted.uff")
    run("monitors", "--structure", "beam", "--new", "ageing", "--parameters", "Ex,Gxy")
    assert "ageing" in run("monitors").stdout
    assert run("alarms").stdout.split() == [
        "id",
        "created_at",
        "monitor_name",
        "parameter",
        "state",
        "acknowledged_by",
        "note",
        "none",
    ]


def test_points_are_stated_where_no_uff_file_does(run: Run, tmp_path: Path) -> None:
    run("projects", "--new", "p")
    run("structures", "--new", "beam", "--size", "500x40x10", "--density", 2012, "--moduli", MODULI)
    run("campaigns", "--new", "March", "--boundary", "cantilever")
    assert 'next: modalbase points "March" POINTS.csv' in run("points", "March").stderr
    (tmp_path / "points.csv").write_text("label,x_mm,y_mm\n1,112.5,-20\n2,500,20\n")
    shown = run("points", "March", "points.csv").stdout.split()
    assert shown[-8:] == ["1", "112.5", "-20", "0", "2", "500", "20", "0"]
    run("export", "March", "--what", "grid-points", "--out", "out.csv")
    # in place of those that are there
    assert run("points", "March", "out.csv").stdout.split() == shown


def test_what_cannot_be_meant_is_one_line(run: Run) -> None:
    run("projects", "--new", "twice")
    run("projects", "--new", "twice")
    for words, said in {
        ("structures", "--project", "twice"): "2 projects are named 'twice'; state the id",
        ("structures", "--project", "twcie"): "there is 'twice'",
        (
            "structures",
            "--new",
            "x",
            "--size",
            "500x40",
        ): "--size '500x40' is no length x width x thickness",
        ("structures", "--new", "x", "--moduli", "E=3"): "there is no 'E', there is Ex",
        ("campaigns", "--new", "x"): "--new needs --boundary",
        ("campaigns", "--structure", "latest"): "there is no structure yet",
        ("result", "latest"): "there is no update job yet",
        ("modes", "x", "--identify"): "there is no campaign yet",
        ("alarms", "--acknowledge", "x"): "takes the id of an alarm",
    }.items():
        (line,) = run(*words, code=2).stderr.splitlines()
        assert line.startswith("modalbase: ")
        assert said in line


def test_a_profile_stands_in_for_the_environment(
    run: Run, service: LocalService, tmp_path: Path
) -> None:
    profile = {"MODALBASE_PROFILE": str(tmp_path / "profile.json")}
    assert "(401)" in run("login", service.url, "--key", "wrong", code=1, **profile).stderr
    assert "which only you can read" in run("login", service.url, **profile).stdout
    run("projects", MODALBASE_URL="", MODALBASE_API_KEY="", **profile)


def test_a_shell_completes_names(run: Run, service: LocalService, api: httpx.Client) -> None:
    run("projects", "--new", "deck of a bridge")
    words = {"COMP_WORDS": "modalbase structures --project de", "COMP_CWORD": "3"}
    key = api.headers["authorization"].split()[1]
    # completion goes by the name of a process
    around = {"MODALBASE_URL": service.url, "MODALBASE_API_KEY": key}
    shown = modalbase(_MODALBASE_COMPLETE="complete_bash", **words, **around).stdout
    assert shown.splitlines() == ["deck of a bridge"]


# --- the command `modalbase` as a person meets it
# -----------------------------------------------------------------------


def test_version() -> None:
    assert modalbase("--version").stdout == f"modalbase {__version__}\n"


def test_what_cannot_start_says_why(short_folder: Path, empty_database: str) -> None:
    """A schema that is not there, a folder that is a file, another PostgreSQL's files, a port that
    is taken, bad words.
    """
    file, postgres = short_folder / "taken", short_folder / "broken" / "postgres"
    file.write_text("")
    postgres.mkdir(parents=True)
    (postgres / "PG_VERSION").write_text("7\n")  # of another PostgreSQL, or what a full disk left
    on_empty, folders = {"MODALBASE_DATABASE_URL": empty_database}, (file, file / "data")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        *unmade, at_file, below_file, broken, in_use, queue, setting = refusals(
            *(
                (words, on_empty)
                for words in (["serve", "--port", "0"], ["worker"], ["up", "--port", "0"])
            ),
            *(
                (["up", "--port", "0", "--data", str(data)], {})
                for data in (*folders, postgres.parent)
            ),
            (["up", "--port", port, "--data", str(short_folder / "port")], {}),
            (["worker", "--queues", "jobs,imports"], {}),
            (["worker"], {"MODALBASE_JOB_WALL_SECONDS": "soon"}),
        )
    unmade.append(modalbase_here("keys", "create", "--name", "x", **on_empty))
    for ended in unmade:
        assert (ended.returncode, ended.stdout) == (1, "")
        assert "run `modalbase db upgrade`" in ended.stderr
        assert "Traceback" not in ended.stderr
    for data, *both in zip(folders, (at_file, below_file), strict=True):
        for ended in (*both, modalbase_here("keys", "create", "--name", "x", "--data", data)):
            assert (ended.returncode, ended.stdout) == (1, "")
            assert ended.stderr.startswith(f"modalbase: cannot use the data folder {data}: ")
            assert len(ended.stderr.splitlines()) == 1
    assert (broken.returncode, broken.stdout) == (1, "")
    assert "Traceback" not in broken.stderr
    assert f"PostgreSQL does not start in {postgres.parent}" in broken.stderr.splitlines()[-1]
    assert in_use.returncode == 1
    assert (
        in_use.stderr
        == f"modalbase: cannot listen on 127.0.0.1 port {port}: Address already in use; choose"
        " another with --port\n"
    )
    assert (queue.returncode, queue.stdout) == (2, "")
    assert (
        queue.stderr
        == "modalbase: --queues jobs,imports: there is jobs, requests, separated by commas where"
        " several\n"
    )
    assert setting.returncode == 1
    assert setting.stderr.startswith("modalbase: settings: job_wall_seconds: ")


def test_the_command_that_a_refusal_names_makes_the_schema(empty_database: str) -> None:
    assert (
        modalbase_here("db", "current", MODALBASE_DATABASE_URL=empty_database).stdout == "empty\n"
    )
    modalbase_here("db", "upgrade", code=0, MODALBASE_DATABASE_URL=empty_database)
    modalbase_here("keys", "create", "--name", "x", code=0, MODALBASE_DATABASE_URL=empty_database)


def starting(data: Path) -> tuple[subprocess.Popen[str], psutil.Process]:
    """`modalbase up` that has just begun its API, which listens and does not answer yet; and the
    API.
    """
    process = subprocess.Popen(
        [str(COMMAND), "up", "--port", "0", "--data", str(data)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment(),
    )  # fmt: skip

    def api() -> psutil.Process | None:
        assert process.poll() is None, process.communicate()
        for child in psutil.Process(process.pid).children():
            with suppress(psutil.Error):  # one of initdb's, which has ended since
                if "serve" in child.cmdline():
                    return child
        return None

    found = until(api, "the start of the API")
    return process, found


def test_an_api_that_dies_while_starting_ends_up_at_once(short_folder: Path) -> None:
    data = short_folder / "dies"
    process, api = starting(data)
    api.kill()
    shown, errors = process.communicate(timeout=PATIENCE)
    assert (process.returncode, shown) == (1, "")
    assert errors.splitlines()[-1] == "modalbase: the api ended while starting; its log says why"
    wait_until_gone(data)


@pytest.mark.parametrize(("signal_", "code"), [(signal.SIGKILL, -9), long(signal.SIGTERM, 0)])
def test_a_signal_ends_up_while_it_starts(
    short_folder: Path, signal_: signal.Signals, code: int
) -> None:
    data = short_folder / f"dies by {code}"
    process, api = starting(data)
    api.suspend()  # it stays starting
    process.send_signal(signal_)
    api.resume()
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == code, errors
    wait_until_gone(data)


def test_a_signal_that_meets_a_callback_ends_the_command() -> None:
    """Python takes no exception from there: `modalbase up` went on, where SIGTERM met the end of an
    import.
    """
    script = """
import signal, threading, weakref
from service.app.cli.ending import ending

class Thing: ...

with ending():
    thing = Thing()
    watch = weakref.ref(thing, lambda _: signal.raise_signal(signal.SIGTERM))
    del thing
    print("goes on", flush=True)
    threading.Event().wait()
"""
    ended = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "goes on\n", "")


@pytest.mark.parametrize("name", ["", "  ", "x" * 201])
def test_a_users_name_is_as_rest_takes_it(short_folder: Path, name: str) -> None:
    ended = modalbase_here("keys", "create", "--name", name, "--data", short_folder / "names")
    assert (ended.returncode, ended.stdout) == (2, "")
    assert not (short_folder / "names").exists()


@pytest.mark.parametrize(
    "url",
    [
        "postgresql://u:p@secret@127.0.0.1:1/d",
        "postgresql://u:secret@127.0.0.1:1/d",
        "mysql://u:secret@h/d",
        "nonsense",
    ],
)
def test_database_that_does_not_answer_is_a_clear_error(url: str) -> None:
    ended = modalbase_here("keys", "create", "--name", "x", MODALBASE_DATABASE_URL=url)
    assert (ended.returncode, ended.stdout) == (1, "")
    assert ended.stderr.startswith("modalbase: ")
    assert "Traceback" not in ended.stderr
    assert "secret" not in ended.stderr
