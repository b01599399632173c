"""The README's script runs as it stands in a clone, and again: it says what was found, or why nothing was."""

import re

import httpx
import pytest

from service.app.supervisor import LocalService
from tests.support.places import ROOT

(SCRIPT,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), flags=re.DOTALL)


@pytest.fixture
def printed(
    service: LocalService,
    api: httpx.Client,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    script: str,
) -> str:
    """What the script prints when it is run for the second time; nothing stands in the folder but the clone."""
    monkeypatch.chdir(ROOT)
    monkeypatch.setenv("MODALBASE_URL", service.url)
    monkeypatch.setenv("MODALBASE_API_KEY", api.headers["authorization"].split()[1])
    for _ in range(2):
        capsys.readouterr()
        names: dict[str, object] = {}
        exec(compile(script, "README.md", "exec"), names)
        names["lab"].connection.close()
    (project,) = api.get("projects").json()["items"]
    (beam,) = api.get(f"projects/{project['id']}/structures").json()["items"]
    (march,) = api.get(f"structures/{beam['id']}/campaigns").json()["items"]
    assert len(api.get(f"campaigns/{march['id']}/imports").json()["items"]) == script.count("import_file")
    return capsys.readouterr().out


@pytest.mark.parametrize("script", [SCRIPT])
def test_the_script_of_the_readme_updates_a_beam(printed: str) -> None:
    assert len(SCRIPT.strip().splitlines()) <= 15
    lines = printed.splitlines()
    assert lines[0].split(":")[0] in ("usable", "with care", "do not use")
    assert any(line.startswith("warning: ") for line in lines)
    names = [line.split()[0] for line in lines[-7:]]
    assert names == ["Ex", "Ey", "Gxy", "Gxz", "Gyz", "a0", "a1"]


@pytest.mark.parametrize("script", [SCRIPT.replace('campaign.import_file("examples/tutorial/beam.uff")\n', "")])
def test_it_says_in_a_line_why_a_job_failed(printed: str) -> None:
    (line,) = printed.splitlines()
    assert line.startswith("update failed: ")
    assert "has no FRFs" in line
