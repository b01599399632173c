"""`modalbase watch` beside a service that is stopped and started again, and ended itself."""

import json
import os
import signal
import subprocess
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from sqlalchemy import make_url

import modalbase
from service.app.supervisor import LocalService
from tests.support.command import COMMAND, environment, modalbase_here
from tests.support.outage import Proxy
from tests.support.rest import client_of, ok
from tests.support.uff import dataset
from tests.support.waiting import PATIENCE, until
from tests.support.wind import WIND, wind

NAMED = ("--time", "%Y%m%dT%H%M", "--zone", "UTC", "--boundary", "as_modelled")


class Watching:
    """A running `modalbase watch`."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self.process = process
        self.lines: list[dict[str, Any]] = []

    def until(self, outcome: str, file: str = "") -> dict[str, Any]:
        """Its next line of an outcome."""
        while True:
            line = self.process.stdout.readline()  # type: ignore[union-attr]
            assert line, (self.lines, self.process.communicate())
            self.lines.append(json.loads(line))
            if (self.lines[-1]["outcome"], self.lines[-1]["file"]) == (outcome, file):
                return self.lines[-1]


@contextmanager
def watching(folder: Path, *words: str, **env: str) -> Iterator[Watching]:
    line = [COMMAND, "watch", folder, "--structure", "deck", *words]
    line += ["--rest", "0", "--every", "0.1", "--json"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    process = subprocess.Popen(list(map(str, line)), text=True, env=environment(**env), **pipes)
    try:
        yield Watching(process)
    finally:
        process.kill()
        process.communicate()


def arrives(folder: Path, name: str, content: bytes) -> None:
    """A file by rename, so that it is whole at once."""
    part = folder / f"{name}.part"
    part.write_bytes(content)
    part.rename(folder / name)


def test_each_file_is_sent_once_through_outages_and_restarts(
    service: LocalService, tmp_path: Path
) -> None:
    folder = tmp_path / "recordings"
    folder.mkdir()
    mapping = tmp_path / "mapping.json"
    mapping.write_text(json.dumps(WIND))
    with (
        closing(Proxy(make_url(service.url).port)) as proxy,
        client_of(service, "warden") as api,
    ):
        env = {"MODALBASE_URL": f"http://127.0.0.1:{proxy.port}"}
        env["MODALBASE_API_KEY"] = service.new_key("warden")
        with modalbase.connect(service.url, env["MODALBASE_API_KEY"]) as lab:
            structure = lab.new_project("bridge").new_structure("deck")
            structure.new_monitor("deck", watch="modes", covariates=["wind_m_s"])
        words = ("--mapping", str(mapping), "--covariates", "beside", *NAMED)
        arrives(folder, "deck_20260302T0900.npz", wind(1))
        first = watching(folder, *words, **env)
        watch = first.__enter__()
        assert (
            "deck_20260302T0900.csv is not there"
            in (watch.until("waits", "deck_20260302T0900.npz")["detail"])
        )
        arrives(folder, "deck_20260302T0900.csv", b"wind_m_s,temperature_c\n4.2,11\n")
        read = watch.until("read", "deck_20260302T0900.npz")
        assert read["detail"].startswith("1 recordings")
        proxy.close()
        arrives(folder, "deck_20260302T1000.csv", b"wind_m_s;temperature_c\n5,5;12\n")
        arrives(folder, "deck_20260302T1000.npz", wind(2))
        assert "tries again in" in watch.until("outage")["detail"]
        proxy.restore()
        watch.until("read", "deck_20260302T1000.npz")
        watch.process.send_signal(signal.SIGKILL)
        first.__exit__(None, None, None)

        for hour, content in ((11, wind(3)), (12, b"not an archive"), (13, wind(1))):
            arrives(folder, f"deck_20260302T{hour}00.csv", b"wind_m_s\n6\n")
            arrives(folder, f"deck_20260302T{hour}00.npz", content)
        with watching(folder, *words, **env) as watch:
            watch.until("failed", "deck_20260302T1200.npz")
            arrives(folder, "without a time.npz", wind(4))
            arrives(folder, "without a time.csv", b"wind_m_s\n6\n")
            refused = watch.until("failed", "without a time.npz")
            watch.process.send_signal(signal.SIGTERM)
            _, summary = watch.process.communicate(timeout=PATIENCE)
        assert "its name has 0 times of the form %Y%m%dT%H%M" in refused["detail"]
        outcomes = [(one["file"][14:16], one["outcome"]) for one in watch.lines]
        # the bytes of nine o'clock are known under another name too
        assert {("09", "known"), ("10", "known"), ("13", "known"), ("11", "sent")} < set(outcomes)
        assert watch.process.returncode == 4
        assert "3 known, 2 failed" in summary

        campaigns = ok(api.get(f"structures/{structure.id}/campaigns"))["items"]
        shown = [
            (one["performed_at"][11:16], one["covariates"], one["temperature_c"])
            for one in campaigns
        ]
        assert shown == [
            ("09:00", {"wind_m_s": 4.2}, 11),
            ("10:00", {"wind_m_s": 5.5}, 12),
            ("11:00", {"wind_m_s": 6}, None),
            ("12:00", {"wind_m_s": 6}, None),
        ]
        (monitor,) = ok(api.get(f"structures/{structure.id}/monitors"))["items"]
        until(
            lambda: (
                {
                    run["campaign_id"]
                    for run in ok(api.get(f"monitors/{monitor['id']}/runs"))["items"]
                    if run["state"] == "succeeded"
                }
                == {one["id"] for one in campaigns[:3]}
            ),
            "runs of what was read",
        )

        # one that failed is not sent again unless that is asked for, then into its campaign
        os.remove(folder / "without a time.npz")
        line = ["watch", folder, "--structure", "deck", "--like", campaigns[0]["id"], *NAMED[:4]]
        line += ["--covariates", "beside", "--rest", "0", "--once", "--json"]
        done = modalbase_here(*line, code=4, **env)
        assert "was sent before" in done.stdout
        done = modalbase_here(*line, "--retry", code=4, **env)
        listed = ok(api.get(f"structures/{structure.id}/imports"))["items"]
        states = [one["status"] for one in listed]
        assert sorted(states) == ["failed", "failed", *3 * ["succeeded"]]
        assert len(ok(api.get(f"structures/{structure.id}/campaigns"))["items"]) == 4


def test_files_are_read_as_one_of_another_structure_was(
    service: LocalService, tmp_path: Path
) -> None:
    """What stands for its boundary, frame and mapping is found by `project/structure/campaign`."""
    (tmp_path / "first.npz").write_bytes(wind(1))
    (tmp_path / "deck_20260302T0900.npz").write_bytes(wind(2))
    env = {"MODALBASE_URL": service.url, "MODALBASE_API_KEY": service.new_key("warden")}
    with modalbase.connect(service.url, env["MODALBASE_API_KEY"]) as lab:
        project = lab.new_project("two decks")
        before = project.new_structure("old deck").new_campaign("May", boundary="free")
        project.new_structure("new deck")
        line = ["watch", tmp_path, "--structure", "new deck", "--pattern", "deck_*.npz", *NAMED[:4]]
        line += ["--rest", "0", "--once", "--like"]
        like = "two decks/old deck/May"
        refused = modalbase_here(*line, like, code=2, **env)
        assert f"no file was read into campaign '{like}'" in refused.stderr
        before.import_file(tmp_path / "first.npz", mapping=WIND)
        modalbase_here(*line, like, **env)
        (campaign,) = project.structure("new deck").campaigns()
        (read,) = campaign.imports()
        assert (campaign.fields["boundary"], read.fields["mapping"]) == ("free", WIND)
        # what was read without a mapping is so again
        points = dataset("15", f"{1:10d}{0:10d}{0:10d}{0:10d}" + 3 * f"{1:13.5e}")
        (tmp_path / "first.unv").write_bytes(points)
        (tmp_path / "deck_20260302T1000.unv").write_bytes(points)
        before.import_file(tmp_path / "first.unv")
        modalbase_here(*line, like, "--pattern", "deck_*.unv", **env)
        (read,) = project.structure("new deck").campaigns()[-1].imports()
        assert (read.fields["mapping"], read.succeeded) == (None, True)
        refused = modalbase_here(*line, "two decks/old deck/June", code=2, **env)
        assert "June" in refused.stderr
