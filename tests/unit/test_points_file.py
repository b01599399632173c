"""CSV files of grid points that the command line takes."""

from __future__ import annotations

from pathlib import Path

import pytest

from modalbase.client.errors import ClientError
from modalbase.client.measuring import read_points


def test_points_are_read_in_metres(tmp_path: Path) -> None:
    file = tmp_path / "points.csv"
    for text in ("point;y_m;x_mm;z_mm\n7;-0,02;112,5;1\n\n", "\ufefflabel,x_m,z_m,y_mm\n 7,0.1125,0.001,-20\n"):
        file.write_text(text)
        (point,) = read_points(file)
        assert point["label"] == 7
        assert [point["x_m"], point["y_m"], point["z_m"]] == pytest.approx([0.1125, -0.02, 0.001])
    file.write_text("label\tx_mm\ty_mm\n1\t2\t3\n")
    assert read_points(file)[0]["z_m"] == 0


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "line 1: is '', expected label,x_mm,y_mm,z_mm"),
        ("label,x,y\n", "line 1: is 'label,x,y', expected label,x_mm"),
        ("label,x_mm,x_m,y_m\n", "expected label,x_mm"),
        ("label,x_mm,z_mm\n", "expected label,x_mm"),
        ("label,x_mm,y_mm\n\n1,2\n", "line 3: has 2 cells, the header has 3"),
        ("label,x_mm,y_mm\n1,2,left\n", "line 2, y_mm: is 'left', expected a number"),
        ("label,x_mm,y_mm\n1.5,2,3\n", "line 2, label: is '1.5', expected a whole number"),
    ],
)
def test_what_is_no_table_of_points_is_named(tmp_path: Path, text: str, said: str) -> None:
    file = tmp_path / "points.csv"
    file.write_text(text)
    with pytest.raises(ClientError) as refused:
        read_points(file)
    assert said in str(refused.value)
