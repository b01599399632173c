"""The client's commands against the running service, as a script calls them."""

import json
import os
import socket
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import httpx
import nanoarrow as na
import numpy as np
import pytest

from modalbase.client.results import print_result
from modalbase.formats.uff import DatasetReport, Frf, ModeShape, read_file
from service.app.supervisor import LocalService
from service.pages.example import paper
from tests.support.command import modalbase_here
from tests.support.laboratory import Done
from tests.support.lengths import long
from tests.support.rest import ok
from tests.support.waiting import PATIENCE

Run = Callable[..., "subprocess.CompletedProcess[str]"]

REFUSED, USAGE, UNREACHABLE, FAILED = 1, 2, 3, 4


@pytest.fixture
def run(service: LocalService, api: httpx.Client, tmp_path: Path) -> Run:
    key = api.headers["authorization"].split()[1]

    def call(*words: object, code: int = 0, **more: str) -> subprocess.CompletedProcess[str]:
        around = {"MODALBASE_URL": service.url, "MODALBASE_API_KEY": key, **more}
        return modalbase_here(*words, cwd=tmp_path, code=code, **around)

    return call


def one_line(done: subprocess.CompletedProcess[str]) -> str:
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith("modalbase: ")
    return line


@pytest.fixture
def uff(tmp_path: Path) -> Path:
    file = tmp_path / "paper beam.uff"
    file.write_bytes(paper.uff_file())
    return file


@pytest.mark.parametrize("predicted", [False, long(True)])
def test_from_a_file_to_an_updated_model(
    run: Run, structure: str, uff: Path, tmp_path: Path, demo: Done, predicted: bool
) -> None:
    """The file is one's own, the model the demonstration's, which the command line has updated too
    in `test_command_line.py`.
    """
    campaign = run(
        "campaigns", "--structure", structure, "--new", "spring", "--boundary", "cantilever"
    ).stdout.strip()
    listed = run("campaigns").stdout
    assert campaign in listed
    assert "FRP beam" in listed
    (imported,) = json.loads(run("import", uff, "--campaign", campaign, "--json").stdout)
    assert (imported["status"], imported["filename"], imported["counts"]["frfs"]) == (
        "succeeded",
        uff.name,
        33,
    )
    again = run("import", uff, "-c", campaign)
    assert again.stdout.count(imported["id"]) == 1
    assert "the campaign has this file already" in again.stderr
    assert len(json.loads(run("frfs", campaign, "--json", "--limit", "20").stdout)) == 20
    table = run("frfs", campaign).stdout
    assert table.startswith("33 FRFs")
    assert "accelerance" in table

    original = tmp_path / "back.uff"
    run("export", imported["id"], "--what", "original", "--out", original)
    assert original.read_bytes() == uff.read_bytes()

    run = partial(run, MODALBASE_API_KEY=demo.api.headers["authorization"].split()[1])
    assert json.loads(run("result", demo.job, "--json").stdout) == demo.result
    shown = run("result", demo.job)
    assert {"Ex", "GPa", "a0", "µs", "modes", "SAC"} <= set(shown.stdout.split())
    assert all(f"warning: {warning}" in shown.stderr for warning in demo.result["warnings"])
    measured = ok(demo.api.get(demo.path))["campaign_id"]
    if predicted:
        predictions_are_exported(run, demo.job, measured, tmp_path)


def predictions_are_exported(run: Run, job: str, campaign: str, folder: Path) -> None:
    npz, arrow, uff = folder / "p.npz", folder / "p.arrow", folder / "p.uff"
    shown = json.loads(run("export", job, "--what", "predicted", "--out", npz, "--json").stdout)
    assert shown == {"file": str(npz), "bytes": npz.stat().st_size}
    run("export", campaign, "--out", folder / "m.npz")
    with np.load(npz) as predicted, np.load(folder / "m.npz") as measured:
        assert np.array_equal(predicted["id"], measured["id"])
        assert np.array_equal(predicted["response_point"], measured["response_point"])
        assert predicted["values"].shape == measured["values"].shape
        # the model was fitted to these: what is left is noise and model error
        error = np.linalg.norm(predicted["values"] - measured["values"]) / np.linalg.norm(
            measured["values"]
        )
        assert error < 0.3
        values, labels = predicted["values"], predicted["reference_point"]
    run("export", job, "--what", "predicted", "--out", arrow, "--reference", labels[3])
    rows = na.ArrayStream.from_readable(arrow.read_bytes()).read_all().to_pylist()
    assert np.array_equal(
        np.array([complex(r["real"], r["imag"]) for r in rows], np.complex64), values[3]
    )
    run("export", job, "--what", "predicted", "--out", uff, "--fmin", "10", "--fmax", "200")
    read = [item for item in read_file(uff) if isinstance(item, Frf)]
    assert len(read) == len(values)
    assert read[0].id_lines[1] == f"predicted by the updated model, update job {job}"
    assert read[0].values.dtype == np.complex64


def test_values_have_the_digits_that_their_uncertainty_leaves(
    capsys: pytest.CaptureFixture[str],
) -> None:
    common = {"initial": 33.05e9, "identifiable": True}
    known = {
        "estimate": 31.7049e9,
        "standard_deviation": 0.1582e9,
        "interval_95": [31.39e9, 32.01e9],
    }
    near_zero = {"estimate": 23.0, "standard_deviation": 13.0, "interval_95": [-0.2, 48.0]}
    fixed = {"estimate": 2012.0, "standard_deviation": 0.0, "interval_95": [2012.0, 2012.0]}
    parameters = [
        {"name": "Ex", "unit": "Pa", **common, **known},
        {"name": "g_root", "unit": "1/s", "initial": 25.0, "identifiable": False, **near_zero},
        {"name": "Gyz", "unit": "Pa", "tied_to": "Gxz", **common, **known},
        {"name": "density", "unit": "kg/m³", **common, "initial": None, **fixed},
    ]
    criteria = {"sac": [0.5, 1.0], "frac": [1.0], "csac_mean": 0.99, "csf_mean": None}
    document = {
        "parameters": parameters,
        "modes": [],
        "correlation": {**criteria, "initial": criteria, "held_out": None},
        "warnings": ["look"],
    }
    print_result("update", document, published={"Ex": 31.66e9})
    said = capsys.readouterr()
    lines = [line.split() for line in said.out.splitlines()]
    assert ["Ex", "GPa", "33.05", "31.70", "0.16", "31.39", "…", "32.01", "yes", "31.66"] in lines
    assert [
        "Gyz",
        "GPa",
        "33.05",
        "31.70",
        "0.16",
        "31.39",
        "…",
        "32.01",
        "as",
        "Gxz",
        "–",
    ] in lines
    assert ["g_root", "1/s", "25", "23", "13", "0", "…", "48", "no", "–"] in lines
    assert ["density", "kg/m³", "–", "2012", "0", "2012", "…", "2012", "yes", "–"] in lines
    assert ["updated", "0.7500", "1.0000", "0.9900", "–"] in lines
    assert said.err == "warning: look\n"


def test_a_size_in_metres_is_refused_until_it_is_confirmed(run: Run, project: str) -> None:
    def new(size: str, *more: str, code: int = 0) -> subprocess.CompletedProcess[str]:
        return run(
            "structures",
            "--project",
            project,
            "--new",
            size,
            "--size",
            size,
            "--json",
            *more,
            code=code,
        )

    said = one_line(new("0.5x0.04x0.01", code=REFUSED))
    assert (
        "/geometry/length_m: is 0.0005 m (0.5 mm), usual is 0.02 m (20 mm) to 100 m; did you mean"
        " 0.5 m (500 mm)?" in said
    )
    assert "--confirm" in said
    assert json.loads(new("0.5x0.04x0.01", "--confirm").stdout)["geometry"]["length_m"] == 0.0005
    assert new("500x40x10").stderr == ""


def test_structures_are_listed_for_the_commands_that_want_their_id(
    run: Run, structure: str, project: str
) -> None:
    assert structure in run("structures").stdout
    (found,) = json.loads(run("structures", "--project", project, "--json").stdout)
    assert (found["id"], found["name"], found["project_name"]) == (structure, "FRP beam", "tests")
    assert "--project or --structure" in one_line(
        run("campaigns", "--project", project, "--structure", structure, code=USAGE)
    )


def test_an_export_goes_through_a_pipe_and_leaves_it_there(
    run: Run, api: httpx.Client, campaign: str, tmp_path: Path
) -> None:
    """As to /dev/null, which a file must not replace."""
    points = {"items": [{"label": 1, "x_m": 0.25, "y_m": 0, "z_m": 0}]}
    api.put(f"campaigns/{campaign}/grid-points", json=points).raise_for_status()
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with ThreadPoolExecutor() as pool:
        read = pool.submit(pipe.read_text)
        run("export", campaign, "--what", "grid-points", "--format", "csv", "--out", pipe)
        assert read.result(PATIENCE).splitlines() == ["label,x_m,y_m,z_m", "1,0.25,0.0,0.0"]
    assert pipe.is_fifo()


@pytest.mark.parametrize(
    "words",
    [
        "export CAMPAIGN --what grid-points --format csv --out -",
        long("campaigns --json"),
    ],
)
def test_a_full_disk_is_one_line(
    campaign: str, service: LocalService, api: httpx.Client, words: str
) -> None:
    environment = {
        "MODALBASE_URL": service.url,
        "MODALBASE_API_KEY": api.headers["authorization"].split()[1],
    }
    command = words.replace("CAMPAIGN", campaign).split()
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "service", *command],
            env=os.environ | environment, stdout=full, stderr=subprocess.PIPE, text=True, timeout=PATIENCE, check=False,
        )  # fmt: skip
    assert (done.returncode, done.stderr) == (USAGE, "modalbase: cannot write: no space left\n")


def test_modes_and_grid_points_are_exported(
    run: Run, api: httpx.Client, campaign: str, tmp_path: Path
) -> None:
    points = {"items": [{"label": 1, "x_m": 0.25, "y_m": 0, "z_m": 0}]}
    api.put(f"campaigns/{campaign}/grid-points", json=points).raise_for_status()
    shape = [{"point": 1, "direction": 3, "real": 1.0, "imag": 0.0}]
    body = {
        "name": "typed",
        "modes": [{"frequency_hz": 12.5, "damping_ratio": 0.01, "shape": shape}],
    }
    modes = api.post(f"campaigns/{campaign}/mode-sets", json=body).raise_for_status().json()["id"]
    file = tmp_path / "modes.unv"
    shown = json.loads(run("export", modes, "--what", "modes", "--out", file, "--json").stdout)
    assert shown == {"file": str(file), "bytes": file.stat().st_size}
    contents = list(read_file(file))
    assert [c.frequency_hz for c in contents if isinstance(c, ModeShape)] == [12.5]
    assert all(c.outcome == "read" for c in contents if isinstance(c, DatasetReport))
    written = run(
        "export", campaign, "--what", "grid-points", "--out", "-", "--format", "csv"
    ).stdout
    assert written.splitlines() == ["label,x_m,y_m,z_m", "1,0.25,0.0,0.0"]
    assert "--point" in one_line(
        run("export", modes, "--what", "modes", "--out", "m.uff", "--point", 1, code=USAGE)
    )


def test_coupons_come_in_from_a_machines_files(
    run: Run, api: httpx.Client, structure: str, tmp_path: Path
) -> None:
    body = {"name": "0 degrees", "constants": ["Ex"]}
    batch = (
        api.post(f"structures/{structure}/coupon-batches", json=body)
        .raise_for_status()
        .json()["id"]
    )
    lines = ["Load (kN),Strain (%)", *(f"{0.4 * i:.3f},{0.02 * i:.4f}" for i in range(51))]
    for name, end in (("A1", ""), ("A2", "\n")):  # two files, for one that comes twice is refused
        (tmp_path / f"{name}.csv").write_text("\n".join(lines) + end)
    about = tmp_path / "about.json"
    about.write_text(
        json.dumps(
            {
                "dimensions": {"unit": "mm", "width": [25], "thickness": [2]},
                "columns": {"force": "Load", "strain": "Strain"},
                "specimens": {"A2": {"excluded": True, "exclusion_reason": "slipped"}},
            }
        )
    )
    assert "--about" in one_line(run("coupons", batch, tmp_path / "A1.csv", code=USAGE))
    done = json.loads(
        run(
            "coupons", batch, tmp_path / "A1.csv", tmp_path / "A2.csv", "--about", about, "--json"
        ).stdout
    )
    assert [(c["specimen"], c["excluded"]) for c in done["coupons"]] == [
        ("A1", False),
        ("A2", True),
    ]
    # E = 400 N / 50 mm² / 200 µε
    assert done["summary"]["constants"]["Ex"]["mean"] == pytest.approx(40e9, rel=1e-9)
    shown = run("coupons", batch)
    assert "slipped" in shown.stdout
    assert "D3039 asks for at least 5" in shown.stderr
    wrong = tmp_path / "wrong.json"
    wrong.write_text('{"specimens": ["A1"]}')
    assert "specimens" in one_line(
        run("coupons", batch, tmp_path / "A1.csv", "--about", wrong, code=USAGE)
    )
    again = json.loads(
        run("coupons", batch, tmp_path / "A1.csv", "--about", about, "--json").stdout
    )
    assert again == done  # sent again as it was, it is there already
    other = (tmp_path / "A1.csv").rename(tmp_path / "A3.csv")
    refused = one_line(run("coupons", batch, other, "--about", about, code=REFUSED))
    assert "A3.csv" in refused
    assert "already, as specimen A1" in refused


def test_a_file_that_cannot_be_read_fails_by_name(
    run: Run, campaign: str, uff: Path, tmp_path: Path
) -> None:
    bad = tmp_path / "bad.uff"
    bad.write_bytes(uff.read_bytes()[:-1000])
    done = run("import", uff, bad, "--campaign", campaign, code=FAILED)
    assert "succeeded" in done.stdout
    assert "bad.uff" in done.stderr.splitlines()[-1]
    assert "the file was cut or changed" in done.stderr


def test_a_dry_run_stores_nothing(run: Run, campaign: str, uff: Path) -> None:
    (report,) = json.loads(run("import", uff, "-c", campaign, "--dry-run", "--json").stdout)
    assert report["dry_run"]
    assert report["counts"]["frfs"] == 33
    assert json.loads(run("frfs", campaign, "--json").stdout) == []


def test_errors_are_one_line_with_an_exit_code(run: Run, campaign: str, tmp_path: Path) -> None:
    nobody = "00000000-0000-0000-0000-000000000000"
    assert "no campaign" in one_line(run("frfs", nobody, code=REFUSED))
    assert "no id" in one_line(run("frfs", "../projects", code=USAGE))
    assert "404" in one_line(run("export", campaign, "--out", "x.npz", code=REFUSED))
    assert list(tmp_path.glob("x.npz*")) == []
    assert "--format" in one_line(run("export", campaign, "--out", "x.dat", code=USAGE))
    assert "(401)" in one_line(run("frfs", campaign, code=REFUSED, MODALBASE_API_KEY="wrong"))
    assert "MODALBASE_API_KEY" in one_line(run("frfs", campaign, code=USAGE, MODALBASE_API_KEY=""))
    assert "no URL" in one_line(run("frfs", campaign, "--url", "localhost", code=USAGE))
    with socket.socket() as deaf:
        deaf.bind(("127.0.0.1", 0))  # and does not listen
        url = f"http://127.0.0.1:{deaf.getsockname()[1]}"
        assert f"no answer from {url}" in one_line(
            run("frfs", campaign, "--url", url, code=UNREACHABLE)
        )
    recipe = tmp_path / "recipe.json"
    recipe.write_text('{"weigting": "log"}')
    assert "/weigting" in one_line(run("update", campaign, "--recipe", recipe, code=REFUSED))
    assert "ASCII" in one_line(run("update", campaign, "--idempotency-key", "März", code=USAGE))
    recipe.write_text("[1]")
    assert "no JSON object" in one_line(run("update", campaign, "--recipe", recipe, code=USAGE))
    run("import", tmp_path / "absent.uff", "-c", campaign, code=USAGE)


def test_an_update_that_fails_says_why(run: Run, campaign: str) -> None:
    queued = run("update", campaign, "--idempotency-key", "k1").stdout.strip()
    assert run("update", campaign, "--idempotency-key", "k1").stdout.strip() == queued
    assert "has no FRFs" in one_line(run("update", campaign, "--wait", code=FAILED))
