"""From an empty database to a figure, each step one command, things by name."""

import json
import subprocess
from collections.abc import Callable
from pathlib import Path

import httpx
import pytest

from service.app.demo import paper
from service.app.supervisor import LocalService
from tests.support.command import modalbase, modalbase_here

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
    (tmp_path / "beam.uff").write_bytes(paper.uff_file())
    assert "next: modalbase projects --new" in run("projects").stderr
    run("projects", "--new", "bridge deck")
    made = run("structures", "--new", "beam", "--size", "500x40x10", "--density", 2012, "--moduli", MODULI)
    assert 'next: modalbase campaigns --new NAME --structure "beam"' in made.stderr
    structure = api.get(f"structures/{made.stdout.strip()}").json()
    assert structure["geometry"] == {"length_m": 0.5, "width_m": 0.04, "thickness_m": 0.01}
    assert structure["material"]["Gxy_Pa"] == pytest.approx(5.73e9)
    stated = ("--temperature", 21.5, "--sensor-mass", 1.8, "--sensor-point", 3, "--boundary", "cantilever")
    made = run("campaigns", "--new", "March", "--structure", "bridge deck/beam", *stated, "--json")
    campaign = json.loads(made.stdout)
    assert campaign["temperature_c"] == 21.5
    assert campaign["instruments"]["sensor_mass_kg"] == pytest.approx(0.0018)
    assert 'next: modalbase update "March" --wait' in run("import", "beam.uff", "--campaign", "March").stderr
    identified = run("modes", "March", "--identify", "--band", "10-1000")
    assert "25.6" in identified.stdout
    first = json.loads(run("modes", "March", "--json").stdout)
    hz = first["modes"][-1]["frequency_hz"]
    edited = json.loads(run("modes", "March", "--drop", f"{hz:.6g}", "--why", "too high", "--json").stdout)
    assert [mode["frequency_hz"] for mode in edited["modes"]] == [m["frequency_hz"] for m in first["modes"][:-1]]
    assert edited["details"]["decisions"][0]["reason"] == "too high"
    run("modes", "March", "--mode-set", edited["id"], "--keep", f"{hz:.6g}", code=2)
    queued = run("update", "latest", "--mode-set", "latest").stdout.strip()
    shown = run("update", "March", "--wait")
    assert "Ex" in shown.stdout
    listed = json.loads(run("jobs", "--campaign", "March", "--json").stdout)
    assert [one["id"] for one in listed][1] == queued
    assert run("jobs").stdout.count("March") == 2
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
    assert run("points", "March", "out.csv").stdout.split() == shown  # in place of those that are there


def test_what_cannot_be_meant_is_one_line(run: Run) -> None:
    run("projects", "--new", "twice")
    run("projects", "--new", "twice")
    for words, said in {
        ("structures", "--project", "twice"): "2 projects are named 'twice'; state the id",
        ("structures", "--project", "twcie"): "there is 'twice'",
        ("structures", "--new", "x", "--size", "500x40"): "--size '500x40' is no length x width x thickness",
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


def test_a_profile_stands_in_for_the_environment(run: Run, service: LocalService, tmp_path: Path) -> None:
    profile = {"MODALBASE_PROFILE": str(tmp_path / "profile.json")}
    assert "(401)" in run("login", service.url, "--key", "wrong", code=1, **profile).stderr
    assert "which only you can read" in run("login", service.url, **profile).stdout
    run("projects", MODALBASE_URL="", MODALBASE_API_KEY="", **profile)


def test_a_shell_completes_names(run: Run, service: LocalService, api: httpx.Client) -> None:
    run("projects", "--new", "deck of a bridge")
    words = {"COMP_WORDS": "modalbase structures --project de", "COMP_CWORD": "3"}
    key = api.headers["authorization"].split()[1]
    around = {"MODALBASE_URL": service.url, "MODALBASE_API_KEY": key}  # completion goes by the name of a process
    shown = modalbase(_MODALBASE_COMPLETE="complete_bash", **words, **around).stdout
    assert shown.splitlines() == ["deck of a bridge"]
