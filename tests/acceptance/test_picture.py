"""The README's picture is what the code draws: the updated model lies on the measurement, the initial one does not."""

from pathlib import Path

import numpy as np

from tests.support.places import ROOT

DRAWN = ROOT / "docs/images/beam.svg"


def test_the_pictures_updated_model_lies_on_the_measurement(tmp_path: Path) -> None:
    from examples import picture  # loads matplotlib

    frfs = picture.prediction()
    peak = np.abs(frfs.measured).max(axis=1, keepdims=True)
    # 1 % noise of each record's rms is 0.5 % of its peak at the most; the initial model is off by a resonance's width.
    assert np.abs((frfs.updated - frfs.measured) / peak).max() < 0.03
    assert np.abs((frfs.initial - frfs.measured) / peak).max() > 0.5
    picture.main(str(tmp_path / "beam.svg"))
    again = (tmp_path / "beam.svg").read_text()
    assert again.count("<path") == DRAWN.read_text().count("<path")
    for text in (again, DRAWN.read_text()):
        assert all(color.lower() in text.lower() for _, color, *_ in picture.CURVES)
