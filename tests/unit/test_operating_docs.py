"""docs/operating.md names every setting, with its default and its meaning."""

from pathlib import Path
from typing import Any

import pytest

from service.settings import MIB, Settings

PAGE = (Path(__file__).parents[2] / "docs" / "operating.md").read_text()


def row(name: str, field: Any) -> str:
    factory = field.default_factory
    default = factory.__doc__.splitlines()[0].rstrip(".") if factory else written(name, field.default)
    return f"| `MODALBASE_{name.upper()}` | {default} | {field.description} |"


def written(name: str, default: object) -> str:
    if default is None or default == "":
        return ""
    if isinstance(default, bool):
        return "on" if default else "off"
    if isinstance(default, int) and default % MIB == 0 and "bytes" in name:
        return f"{default // MIB} MiB"
    return f"{default:g}" if isinstance(default, float) else str(default)


@pytest.mark.parametrize("name", list(Settings.model_fields))
def test_every_setting_is_described(name: str) -> None:
    expected = row(name, Settings.model_fields[name])
    assert expected in PAGE.splitlines(), f"docs/operating.md wants the line\n{expected}"


def test_no_other_setting_is_named() -> None:
    lines = [line for line in PAGE.splitlines() if line.startswith("| `MODALBASE_")]
    assert len(lines) == len(Settings.model_fields)
