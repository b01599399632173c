"""The README's script runs as it stands."""

from __future__ import annotations

import re

import pytest

from service.demo.paper import uff_file
from service.supervisor import LocalService
from tests.support.places import ROOT

README = ROOT / "README.md"


def test_the_script_of_the_readme_updates_a_beam(service: LocalService, capsys: pytest.CaptureFixture[str]) -> None:
    (script,) = re.findall(r"```python\n(.*?)```", README.read_text(), flags=re.DOTALL)
    script = script.replace("http://127.0.0.1:8000", service.url).replace('open(UFF_FILE, "rb").read()', "UFF_BYTES")
    exec(
        compile(script, "README.md", "exec"),
        {"KEY": service.new_key("reader"), "UFF_BYTES": uff_file()},
    )
    printed = capsys.readouterr().out.splitlines()
    assert printed[0] == "succeeded"
    assert [line.split()[0] for line in printed[1:]] == ["Ex", "Ey", "Gxy", "Gxz", "Gyz", "a0", "a1"]
