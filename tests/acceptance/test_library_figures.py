"""Figures of what was measured, as a notebook shows them, and what a library says that is not
there.
"""

import sys
from pathlib import Path

import httpx
import numpy as np
import pytest

import modalbase
from service.app.supervisor import LocalService
from service.pages.example import paper
from tests.support.laboratory import BEAM

STEADY = np.arange(1.0, 4.0)


def test_what_was_measured_shows_itself(
    service: LocalService, api: httpx.Client, tmp_path: Path
) -> None:
    file = tmp_path / "beam.uff"
    file.write_bytes(paper.uff_file())
    with modalbase.connect(service.url, api.headers["authorization"].split()[1]) as lab:
        body = {**BEAM["geometry"], **BEAM["material"], "density_kg_m3": 2012.0}
        campaign = (
            lab.new_project("drawn")
            .new_structure("beam", **body)
            .new_campaign("March", "cantilever")
        )
        campaign.import_file(file)
        _, values = next(iter(campaign.frfs(reference=7).spectra()))
        figure = campaign.figure("frf", reference=7, fmax=200.0)
        assert figure._repr_svg_().lstrip().startswith("<?xml")
        assert figure.save(tmp_path / "frf.pdf").read_bytes().startswith(b"%PDF")
        traces, layout = (figure.plotly()[part] for part in ("data", "layout"))
        assert layout["title"]["text"].endswith("/ 7+Z")
        assert max(traces[0]["x"]) <= 200
        np.testing.assert_allclose(traces[0]["y"], np.abs(values)[: len(traces[0]["y"])], rtol=1e-4)
        with pytest.raises(modalbase.ClientError, match="FRF that matches"):
            campaign.figure("frf", point=4711).plotly()
        with pytest.raises(modalbase.ClientError, match=r"'nonsense'; there are frf, hits"):
            campaign.figure("nonsense").plotly()
        with pytest.raises(modalbase.ClientError, match=r"no 'referense' to choose by"):
            campaign.figure("frf", referense=3)

        modes = campaign.identify(band_hz=[10, 200])
        drawn = modes.plot().plotly()
        titles = [note["text"] for note in drawn["layout"]["annotations"]]
        assert titles == [f"mode {n}: {hz:.4g} Hz" for n, hz in enumerate(modes.frequency_hz, 1)]
        meta = drawn["layout"]["meta"]
        dofs, shapes = modes.shapes()
        assert meta["points"] == [point for point, _ in dofs]
        for mode, shape in zip(meta["modes"], shapes, strict=True):
            own = np.array(mode["measured"])
            assert abs(np.vdot(own, shape)) ** 2 > 0.9 * (own @ own) * np.vdot(shape, shape).real
        typed = campaign.new_mode_set("typed", [{"frequency_hz": 25.6}])
        with pytest.raises(modalbase.ClientError, match=r"no shapes .*\(409\)"):
            typed.plot().plotly()


def test_frfs_of_a_script_are_drawn_without_a_service(monkeypatch: pytest.MonkeyPatch) -> None:
    frfs = modalbase.Frfs.from_arrays(
        STEADY, [STEADY * 1j, -STEADY], response=[(1, 3), (2, -3)], reference=[(5, 3), (5, 3)]
    )
    magnitude, phase = frfs.plot().axes
    np.testing.assert_array_equal(magnitude.lines[1].get_ydata(), STEADY)
    np.testing.assert_allclose(phase.lines[0].get_ydata(), 90)
    assert [text.get_text() for text in magnitude.get_legend().get_texts()] == [
        "1:+3 / 5:+3",
        "2:-3 / 5:+3",
    ]
    assert magnitude.get_ylabel() == "|accelerance| [m/s²/N]"
    for package, draw in {"matplotlib": frfs.plot, "xarray": frfs.to_xarray}.items():
        for name in [name for name in sys.modules if name.partition(".")[0] == package]:
            monkeypatch.delitem(sys.modules, name)
        monkeypatch.setitem(sys.modules, package, None)  # as if it were not installed
        with pytest.raises(
            modalbase.ClientError, match=f"{package} is not installed: pip install {package}$"
        ):
            draw()
