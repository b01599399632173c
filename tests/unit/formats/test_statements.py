"""What files say of a test in words: when, with which instruments, how sensitive their channels
are; and that nothing is taken which could mean two things.
"""

from datetime import UTC, datetime
from pathlib import Path

import h5py
import numpy as np
import pytest
from nptdms import ChannelObject, RootObject, TdmsWriter
from scipy.io import savemat
from scipy.io.wavfile import write

from modalbase.formats.statements import (
    date_in,
    instruments,
    performed_at,
    texts_in,
    with_sensitivities,
)

AT = datetime(2025, 6, 2, 10, 5)
WORDS = {
    "performed_at": "2025-06-02 10:05:00",
    "hammer": "086C03",
    "accelerometer_serial": "LW1234",
    "acc_sensitivity": "10.2 mV/g",
}
SAMPLES = np.arange(100.0)
LVM = (
    "LabVIEW Measurement\nSeparator\tTab\nDate\t2025/06/02\t2025/06/02\nTime\t10:05:00.25\n"
    "Hammer\t086C03\nSensor serial\tLW1234\n"
)


def npz(path: Path) -> None:
    np.savez(path, force=SAMPLES, acc=SAMPLES, **WORDS)


def mat(path: Path) -> None:
    savemat(path, {"force": SAMPLES, "acc": SAMPLES, "info": {"date": AT.isoformat()}, **{
        name: text for name, text in WORDS.items() if name != "performed_at"}})  # fmt: skip


def csv(path: Path) -> None:
    above = "# Date: 02.06.2025\n# Time: 10:05\n# Hammer: 086C03\n# Accelerometer S/N: LW1234\n"
    path.write_text(above + "t;force\n" + "".join(f"{i / 100};{i}.5\n" for i in range(50)))


def lvm(path: Path) -> None:
    path.write_text(LVM + "X\tforce\tacc\n" + "".join(f"{i}.5\t{i}.1\t{i}.2\n" for i in range(50)))


def tdms(path: Path) -> None:
    own = {"wf_increment": 1e-3, "wf_start_time": np.datetime64("2025-06-02T10:05:00"),
           "Serial Number": "LW1234", "Sensitivity": "10.2 mV/g", "unit_string": "V"}  # fmt: skip
    with TdmsWriter(path) as writer:
        root = RootObject({"hammer": "086C03"})
        writer.write_segment([root, ChannelObject("run", "Accelerometer", SAMPLES, own)])


def wav(path: Path) -> None:
    write(path, 1000, SAMPLES.astype(np.float32))
    chunk = bytes(320) + b"2025-06-0210:05:00"
    with path.open("ab") as file:
        file.write(b"bext" + len(chunk).to_bytes(4, "little") + chunk)


def hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["force"], file["acc"] = SAMPLES, SAMPLES
        file.attrs.update(WORDS)


def mdf(path: Path) -> None:
    asammdf = pytest.importorskip("asammdf", reason="the extra mdf is not installed")
    with asammdf.MDF() as file:
        file.append(asammdf.Signal(SAMPLES, SAMPLES / 1e3, name="force"))
        file.header.start_time = AT.replace(tzinfo=UTC)
        file.save(path.with_suffix(".mf4")).rename(path)


@pytest.mark.parametrize("make", [npz, mat, csv, lvm, tdms, wav, hdf5, mdf])
def test_a_file_says_when_and_with_what_it_was_measured(make, tmp_path: Path) -> None:
    path = tmp_path / f"hit.{make.__name__}"
    make(path)
    texts = texts_in(path, make.__name__.replace("lvm", "csv"), 1 << 20)
    assert performed_at(texts) == (AT.replace(tzinfo=UTC) if make in (tdms, mdf) else AT)
    said = {"hammer/model": "086C03", "sensor/serial": "LW1234"}
    assert instruments(texts) == ({} if make in (wav, mdf) else said)


def test_what_could_mean_two_things_is_left_out() -> None:
    assert date_in("13/06/2025") == datetime(2025, 6, 13)
    assert performed_at({"date": "2025-06-02", "test_date": "2025-06-03"}) is None
    assert performed_at({"calibration_date": "2025-06-02", "created": "2025-06-02"}) is None
    assert instruments({"sensor_serial": "1", "accelerometer_serial": "2"}) == {}
    assert instruments({"hammer_colour": "red"}) == {}


@pytest.mark.parametrize(
    ("unit", "said", "taken"),
    [("V", "10.2 mV/g", "10.2 mV/g"), ("g", "10.2 mV/g", None), ("V", "10.2", None)],
)
def test_a_sensitivity_counts_for_samples_in_volts(unit: str, said: str, taken: str | None) -> None:
    channel = {"variable": "acc 1", "unit": unit, "sensitivity": None}
    mapped = with_sensitivities({"channels": [channel]}, {"acc_1_sensitivity": said})
    assert mapped["channels"][0]["sensitivity"] == taken
