"""The study of Mondal and Chakraborty (2015) comes out again: what its tables and text give, to
stated tolerances.
"""

import runpy
import sys

import numpy as np
import pytest

from examples.paper import cantilever, free_beam, simulated_beam
from examples.paper.published import (
    CANTILEVER_CONVERGED,
    FREE_UPDATED,
    SIMULATED_CONVERGED,
    TABLE_3_UPDATED_HZ,
    TABLE_4_UPDATED,
)

ONE_OPTIMUM = 1e-3  # what the project promises of all trial starts; they are some 1e-8 apart


@pytest.fixture(scope="module")
def simulated() -> simulated_beam.Study:
    return simulated_beam.study()


@pytest.fixture(scope="module")
def clamped() -> cantilever.Study:
    return cantilever.Study()


@pytest.fixture(scope="module")
def hung() -> free_beam.Study:
    return free_beam.study()


def test_table_1_bending_modes(simulated: simulated_beam.Study) -> None:
    # Timoshenko's beam, closed form, four modes; 40 quadratic elements are good to 1e-5, the
    # figures to half a digit.
    np.testing.assert_allclose(
        simulated.frequency_hz[:4], [24.943, 156.018, 435.523, 849.688], rtol=3e-5
    )


def test_the_simulated_beam_gives_its_modulus_and_damping_back(
    simulated: simulated_beam.Study,
) -> None:
    rows = {row.name: row for row in simulated.update.parameters}
    assert list(rows) == ["E", "a0", "a1"]
    for name, value in zip(rows, (30e9, *SIMULATED_CONVERGED), strict=True):
        # the project's target of damping at 1 % noise
        assert rows[name].estimate == pytest.approx(value, rel=0.01)
        assert rows[name].interval_95[0] < value < rows[name].interval_95[1]
    # 0.06 of its deviation, which allows for the inputs
    assert rows["E"].estimate == pytest.approx(30e9, rel=3e-3)
    assert [mode.kind for mode in simulated.update.modes[:5]] == ["bending"] * 5


def test_table_2_read_in_hz_gives_table_1s_damping(simulated: simulated_beam.Study) -> None:
    by_1_and_2, by_5, by_2_and_3 = 100 * simulated.table_2_ratios
    # Table 2 prints three digits of a0 and a1, and two trials give mode 2 two values: a tenth of a
    # per cent it is.
    assert by_1_and_2[:2] == pytest.approx([5.0, 0.9], abs=0.05)
    assert by_2_and_3[1:3] == pytest.approx([1.1, 1.5], abs=0.05)
    assert by_5[4] == pytest.approx(3.2, abs=0.05)


def test_table_2s_starts_reach_one_point(simulated: simulated_beam.Study) -> None:
    assert simulated.trials.spread < ONE_OPTIMUM
    assert simulated.recovered.spread < ONE_OPTIMUM
    # Noise-free FRFs of a Rayleigh body: nothing but the convergence tolerance is left.
    np.testing.assert_allclose(
        simulated.recovered.found, np.tile(SIMULATED_CONVERGED, (5, 1)), rtol=1e-6
    )
    assert np.all(simulated.trials.sac_after > simulated.trials.sac_before)


def test_the_papers_simulated_pair_contradicts_its_table_2(simulated: simulated_beam.Study) -> None:
    (low, high), a1 = np.sort(simulated.other_ends[:, 0]), simulated.other_ends[:, 1]
    assert low < SIMULATED_CONVERGED[0] < high  # a0 is explained by the unknown ratio 4
    assert SIMULATED_CONVERGED[1] > 3 * a1.max()  # a1 is not
    assert simulated.paper_ratios[4] > 4 * simulated.ratios[4]


def test_table_3s_fe_frequencies_come_from_table_4(clamped: cantilever.Study) -> None:
    # the project's target: 0.05 %
    np.testing.assert_allclose(clamped.table_3_hz, TABLE_3_UPDATED_HZ, rtol=5e-4)
    high = clamped.thick_hz / TABLE_3_UPDATED_HZ - 1
    assert np.all((high > 0.009) & (high < 0.013))  # the printed thickness cannot be what was used


@pytest.mark.parametrize(
    ("name", "tolerance"), [("Ex", 0.005), ("Gxy", 0.02), ("Gxz", 0.10), ("Gyz", 0.10)]
)
def test_table_4_comes_from_table_3s_measurements(
    clamped: cantilever.Study, name: str, tolerance: float
) -> None:
    """The project's targets; the paper's initial Gxz and Gyz are not printed, so these are the
    loosest.
    """
    rows = {row.name: row for row in clamped.update.parameters}
    assert rows[name].estimate == pytest.approx(TABLE_4_UPDATED[name], rel=tolerance)
    low, high = rows[name].interval_95
    assert low < TABLE_4_UPDATED[name] < high


def test_the_cantilever_tells_nothing_of_ey(clamped: cantilever.Study) -> None:
    rows = {row.name: row for row in clamped.update.parameters}
    assert not rows["Ey"].identifiable
    # the coupon's value, as in the paper
    assert rows["Ey"].estimate == pytest.approx(TABLE_4_UPDATED["Ey"], rel=1e-3)
    assert rows["Ex"].identifiable
    assert rows["Gxy"].identifiable


def test_updated_modes_are_as_near_as_the_papers(clamped: cantilever.Study) -> None:
    errors = np.array([mode.error_percent for mode in clamped.update.modes], dtype=float)
    initial = np.array(
        [100 * (mode.initial_hz / mode.measured_hz - 1) for mode in clamped.update.modes]
    )
    assert np.max(np.abs(errors)) < 0.7  # mode 4, as in the paper: 0.65 %
    assert np.linalg.norm(errors) < 0.2 * np.linalg.norm(initial)
    assert all(mode.mac is not None and mode.mac > 0.999 for mode in clamped.update.modes)


def test_table_5s_starts_reach_one_point(clamped: cantilever.Study) -> None:
    for trials in (*clamped.trials.values(), clamped.recovered):
        assert trials.spread < ONE_OPTIMUM
    # 1 % noise on 33 records: some 0.05 % of each coefficient.
    np.testing.assert_allclose(
        clamped.recovered.found, np.tile(CANTILEVER_CONVERGED, (6, 1)), rtol=2e-3
    )
    assert np.all(clamped.recovered.sac_after > 0.9995)
    assert np.all(clamped.recovered.sac_before < 0.96)


@pytest.mark.long
def test_a_body_that_follows_the_law_gives_the_papers_pair_back(clamped: cantilever.Study) -> None:
    """The whole job, identification included: 1 % is the project's target at 1 % noise. The short
    form is the simulated beam.
    """
    rows = {row.name: row for row in clamped.law_update.parameters}
    for name, value in zip(("a0", "a1"), CANTILEVER_CONVERGED, strict=True):
        assert rows[name].estimate == pytest.approx(value, rel=0.01)
        assert rows[name].interval_95[0] < value < rows[name].interval_95[1]


def test_table_3s_damping_is_called_no_rayleigh_law(clamped: cantilever.Study) -> None:
    laws = {law.name: law for law in clamped.update.damping_models}
    assert laws["modal"].preferred
    assert abs(laws["rayleigh"].missed[2]) > 0.3  # the best Rayleigh law misses mode 3 by a third
    assert any(
        "rayleigh law is inadequate" in warning and "mode 3" in warning
        for warning in clamped.update.warnings
    )


def test_held_out_frfs_and_lines_are_predicted(clamped: cantilever.Study) -> None:
    correlation = clamped.update.correlation
    frfs, band = correlation.held_out_frfs, correlation.held_out_band
    assert np.mean(correlation.initial.sac) < 0.8
    assert np.min(correlation.updated.sac) > 0.95
    assert np.min(frfs.agreement.sac) > 0.95  # no worse than the fitted ones
    assert np.min(band.agreement.sac) > 0.95
    assert band.band_hz[0] > 1000
    for held in (frfs, band):
        assert 0.88 <= held.coverage_95 <= 1


@pytest.mark.long
def test_free_beam(hung: free_beam.Study) -> None:
    """The cantilever above is the short form, and the free strips of the golden documents."""
    rows = {row.name: row for row in hung.update.parameters}
    errors = [
        abs(mode.error_percent) for mode in hung.update.modes if mode.error_percent is not None
    ]
    assert len(errors) == 4
    assert max(errors) < 0.4  # four frequencies
    # Of Gxz, ± 22 %, four frequencies say a little less than its prior of ± 30 % does.
    assert [name for name in FREE_UPDATED if rows[name].identifiable] == ["Ex", "Gxy"]
    # The paper's constants leave its modes 0.5 to 2 % low at the printed thickness, so ours are up
    # to 4 % higher.
    assert 1 < rows["Ex"].estimate / FREE_UPDATED["Ex"] < 1.03
    assert 1 < rows["Gxy"].estimate / FREE_UPDATED["Gxy"] < 1.04
    assert np.all(hung.paper_hz[0] < free_beam.FREE_MEASURED_HZ)
    assert np.mean(hung.update.correlation.updated.sac) > 0.95
    assert any(
        "rayleigh law is inadequate" in warning and "mode 3" in warning
        for warning in hung.update.warnings
    )


def test_the_scripts_print_ours_beside_the_papers(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """`python -m examples.paper simulated`, in this process, which has made the study already."""
    monkeypatch.setattr(sys, "argv", ["examples.paper", "simulated"])
    runpy.run_module("examples.paper", run_name="__main__")
    printed = capsys.readouterr().out
    assert "Table 1" in printed
    assert "paper" in printed
    assert "3.16e-05" in printed
    monkeypatch.setattr(sys, "argv", ["examples.paper", "stimulated"])
    with pytest.raises(SystemExit, match="no part named stimulated"):
        runpy.run_module("examples.paper", run_name="__main__")
