"""The examples for a notebook run as they stand: with the service in ten lines, and the core alone."""

import re
import subprocess
import sys

import httpx
import pytest

from service.app.supervisor import LocalService
from tests.support.command import environment
from tests.support.places import ROOT
from tests.support.waiting import PATIENCE


def test_an_update_without_the_service() -> None:
    ended = subprocess.run(
        [sys.executable, "-W", "error", "examples/core.py"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr
    found = dict(re.findall(r"^(\w+) +([\d.e+-]+) ", ended.stdout, flags=re.MULTILINE))
    assert float(found["Ex"]) == pytest.approx(31.66e9, rel=0.005)  # Table 4; the project's targets
    assert float(found["Gxy"]) == pytest.approx(6.30e9, rel=0.02)
    assert "Ey" not in found  # fixed
    assert len(re.findall(r"^mode \d", ended.stdout, flags=re.MULTILINE)) == 5
    assert "mode 3 (torsion): 399.28 Hz" in ended.stdout
    assert "held-out points (5, 17, 29)" in ended.stdout
    assert "rayleigh law is inadequate" in ended.stdout
    assert "100 % done" in ended.stderr


def test_the_main_job_in_ten_lines(service: LocalService, api: httpx.Client) -> None:
    lines = [
        line
        for line in (ROOT / "examples" / "notebook.py").read_text().splitlines()
        if line.strip() and not line.startswith('"""')
    ]
    assert len(lines) <= 10
    key = api.headers["authorization"].split()[1]
    ended = subprocess.run(
        [sys.executable, str(ROOT / "examples" / "notebook.py")],
        cwd=ROOT,
        env=environment(MODALBASE_URL=service.url, MODALBASE_API_KEY=key),
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr
    assert re.search(r"^Ex +GPa", ended.stdout, flags=re.MULTILINE)
