"""Files that do not say what their arrays are, in the system's Chromium: columns are chosen, and
nobody writes JSON.
"""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import httpx
import numpy as np
import pytest
from scipy.io import savemat, wavfile

from service.app.supervisor import LocalService
from service.platform.queue.resource import ENDED
from tests.acceptance.test_browser import overflow
from tests.acceptance.test_forms import fill
from tests.golden.inputs import new_campaign
from tests.support.browser import Watched, hindrances, signed_in, watched_page
from tests.support.lengths import long
from tests.support.rest import client_at, finished, ok
from tests.support.uff import axis, set_58
from tests.support.waiting import until
from tests.unit.fecore.signal.test_recording import RATE, recording

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Locator, Page

FREQUENCY = np.arange(1.0, 101.0)
VALUES = FREQUENCY * np.array([[1 + 2j], [3 - 1j]])


def wav(times: list[float], seconds: float) -> bytes:
    file = io.BytesIO()
    whole = recording(times, [1.0] * len(times), seconds)
    wavfile.write(file, int(RATE), np.round(whole.T * 0.25 * 2**31).astype(np.int32))
    return file.getvalue()


def tdms(times: list[float], seconds: float) -> bytes:
    nptdms = pytest.importorskip(
        "nptdms", reason="npTDMS is not installed: pip install 'modalbase[tdms]'"
    )
    file, said = io.BytesIO(), {"wf_increment": 1 / RATE}
    whole = recording(times, [1.0] * len(times), seconds)
    with nptdms.TdmsWriter(file) as written:
        both = zip(("Hammer", "Acc top"), whole, strict=True)
        written.write_segment(
            [nptdms.ChannelObject("daq", name, values, said) for name, values in both]
        )
    return file.getvalue()


def mat(**arrays: Any) -> bytes:
    file = io.BytesIO()
    savemat(file, arrays)
    return file.getvalue()


def dropped(page: Page, files: dict[str, bytes]) -> None:
    """Files are sent together, and looked at."""
    page.set_input_files(
        "#file",
        [
            {"name": name, "mimeType": "application/octet-stream", "buffer": content}
            for name, content in files.items()
        ],
    )
    for name in files:
        page.wait_for_selector(f"form[data-name='{name}']")


def form_of(page: Page, name: str) -> Locator:
    return page.locator(f"form[data-name='{name}']")


def read_so(page: Page, api: httpx.Client, name: str) -> None:
    """Press the button, and wait until what was sent is read and the page shows it, by itself."""
    press_so(page, api, name)
    page.wait_for_selector(
        "html:not([data-leaving]):not(:has([data-job], #uploaded [data-awaited]))", state="attached"
    )


def press_so(page: Page, api: httpx.Client, name: str) -> None:
    form_of(page, name).locator("button[type=submit]").click()
    page.wait_for_selector("main:not(:has(button[type=submit]:disabled))")
    address = urlsplit(page.url).path.rsplit("/", 1)[1]
    until(lambda: all(f["status"] in ENDED for f in sent(api, address)), "the end of all imports")


def sent(api: httpx.Client, campaign: str) -> list[dict[str, Any]]:
    items: list[dict[str, Any]] = ok(api.get(f"campaigns/{campaign}/imports"))["items"]
    return items


def counts(api: httpx.Client, campaign: str) -> list[tuple[str, str, Any]]:
    """Name, state and what came of each file that was read, not only looked at."""
    items = sent(api, campaign)
    sums = [
        (f["filename"], f["status"], f["counts"] and f["counts"]["frfs"] + f["counts"]["records"])
        for f in items
    ]
    return [each for each, item in zip(sums, items, strict=True) if not item["dry_run"]]


@pytest.mark.long
def test_recordings_and_mat_files_are_read_by_choosing_columns(
    seen: Watched, api: httpx.Client
) -> None:
    """A TDMS whose order was wrong first, wavs of a point each read together, FRFs in two parts;
    what was typed is kept. The short forms are the recording and the FRFs below.
    """
    campaign = new_campaign(api, {"name": "bar"}, boundary="free")
    page = seen.goto(f"/ui/campaigns/{campaign}")
    files = {"june.tdms": tdms([1.0, 4.0, 7.0], 10.0), "point_4.wav": wav([1.0, 4.0], 7.0)}
    files |= {
        "point_5.wav": wav([1.5, 4.5], 7.5),
        "frfs.mat": mat(f=FREQUENCY, Hr=VALUES.real, Hi=VALUES.imag),
    }
    dropped(page, files)
    assert page.locator("main textarea").count() == 0
    assert "{" not in page.inner_text("main")

    june = form_of(page, "june.tdms")
    quantities = [june.locator(f"[name='channels/{n}/quantity']").input_value() for n in (0, 1)]
    assert quantities == ["force", "acceleration"]
    june.locator("button:text('Add a point')").click()
    june.locator("[name='recording/order/0/point']").fill("7")
    june.locator("[name='recording/order/0/hits']").fill("2")
    june.locator("[name='channels/1/point']").fill("33")
    june.locator("[name='channels/1/direction']").select_option("3")
    for n in (0, 1):
        june.locator(f"[name='channels/{n}/sensitivity']").fill("1")
    read_so(page, api, "june.tdms")
    page.wait_for_selector("#uploaded .faults:text('has 2 hits, and 3 were found, at 1.00 s')")
    assert form_of(page, "june.tdms").locator("[name='channels/1/point']").input_value() == "33"
    form_of(page, "june.tdms").locator("[name='recording/order/0/hits']").fill("3")
    read_so(page, api, "june.tdms")

    first = form_of(page, "point_4.wav")
    assert (
        "-0.223 to 0.241"
        in first.locator("[name='channels/1/variable'] option >> nth=2").inner_text()
    )
    first.locator("select[data-kind]").select_option("filename")
    for name, value in {"0/quantity": "force", "1/quantity": "acceleration"}.items():
        first.locator(f"[name='channels/{name}']").select_option(value)
    for n in (0, 1):
        first.locator(f"[name='channels/{n}/direction']").select_option("3")
    for name in ("0/sensitivity", "1/sensitivity"):
        first.locator(f"[name='channels/{name}']").fill("0.25")
    first.locator("[name='channels/1/point']").fill("33")
    first.locator("label:has-text('Read point_5.wav so, too') input").check()
    read_so(page, api, "point_4.wav")

    frfs_are_chosen(page)
    assert hindrances(page) == []
    read_so(page, api, "frfs.mat")
    page.click(".tabs a:text('Measurement')")
    page.wait_for_selector("[data-frf-viewer]")
    assert sorted(counts(api, campaign)) == [
        ("frfs.mat", "succeeded", 2),
        ("june.tdms", "failed", None),
        ("june.tdms", "succeeded", 6),
        ("point_4.wav", "succeeded", 4),
        ("point_5.wav", "succeeded", 4),
    ]
    frf = ok(api.get(f"campaigns/{campaign}/frfs"))["items"][1]
    assert (frf["quantity"], frf["reference_point"]) == ("mobility", 5)
    np.testing.assert_array_equal(
        ok(api.get(f"frfs/{frf['id']}/data"))["frfs"][0]["imag"], 2 * VALUES[1].imag
    )


def arrays(form: str, times: list[float], seconds: float) -> bytes:
    """A recording as arrays that an analyser exports."""
    force, response = recording(times, [1.0] * len(times), seconds)
    file, times_s = io.BytesIO(), np.arange(force.size) / RATE
    if form == "npz":
        np.savez(file, force=force, acc=response, fs=RATE)
    elif form == "mat":
        savemat(file, {"force": force, "acc": response, "fs": RATE})
    elif form == "csv":
        np.savetxt(
            file,
            np.column_stack((times_s, force, response)),
            "%.17g",
            ",",
            header="time,force,acc",
            comments="",
        )
    else:
        file.write(time_block(13, "N", 4, force) + time_block(12, "m/s^2", 33, response))
    return file.getvalue()


def time_block(kind: int, unit: str, point: int, samples: np.ndarray) -> bytes:
    rows = ["".join(f"{x:20.11E}" for x in samples[k : k + 4]) for k in range(0, samples.size, 4)]
    header = {"kind": 4, "points": samples.size, "function": 1, "step": f"{1 / RATE:13.5e}"}
    place = {"response": (point, 3), "reference": (0, 0)}
    return set_58(*rows, abscissa=axis(17, "s"), ordinate=axis(kind, unit), **header, **place)


@pytest.mark.parametrize("form", ["mat", long("csv")])
def test_of_other_formats_the_same_recording_is_proposed(
    api: httpx.Client, campaign: str, form: str
) -> None:
    """So the form below asks the same of them as of an npz."""
    looked = []
    for each in ("npz", form):
        content = arrays(each, [1.0, 4.0, 7.0], 10.0)
        params = {"filename": f"minutes.{each}", "dry_run": True}
        answer = api.post(f"campaigns/{campaign}/imports", params=params, content=content)
        looked.append(finished(api, answer.headers["Location"])["found"]["mapping"])
    assert looked[0]["recording"] == looked[1]["recording"]
    assert looked[0]["channels"] == looked[1]["channels"]
    assert all(mapping["sample_rate_hz"] for mapping in looked)


@pytest.mark.parametrize("form", ["npz", long("uff")])
def test_arrays_that_go_on_over_many_hits_are_offered_as_a_recording(
    seen: Watched, api: httpx.Client, form: str
) -> None:
    """Its hits are seen in the force; where the hammer was is all that is asked, and stays while
    other files are looked at. A UFF is read at once, so it says first what it lacks.
    """
    name = f"minutes.{form}"
    campaign = new_campaign(api, {"name": "bar"}, boundary="free")
    page = seen.goto(f"/ui/campaigns/{campaign}")
    dropped(page, {name: arrays(form, [1.0, 4.0, 7.0], 10.0)})
    if form == "uff":
        page.wait_for_selector("#uploaded .faults:text('the force has several hits')")
        page.click("button:text('Say where the hammer hit')")
        page.wait_for_selector(f"form[data-name='{name}'] select[data-kind]")
    asked = form_of(page, name)
    assert asked.locator("select[data-kind]").input_value() == "order"
    quantities = [asked.locator(f"[name='channels/{n}/quantity']").input_value() for n in (0, 1)]
    assert quantities == ["force", "acceleration"]
    for point, hits in enumerate((2, 1)):
        asked.locator("button:text('Add a point')").click()
        asked.locator(f"[name='recording/order/{point}/point']").fill(str(point + 4))
        asked.locator(f"[name='recording/order/{point}/hits']").fill(str(hits))
    known = asked.locator("[name='channels/1/point']").input_value()
    assert known == ("33" if form == "uff" else "")
    asked.locator("[name='channels/1/point']").fill("33")
    if form != "uff":  # which states units and directions
        asked.locator("[name='channels/1/direction']").select_option("3")
        for n in (0, 1):
            asked.locator(f"[name='channels/{n}/sensitivity']").fill("1")
    dropped(page, {"frfs.mat": mat(f=FREQUENCY, Hr=VALUES.real, Hi=VALUES.imag)})
    press_so(page, api, name)
    frfs_are_chosen(page)
    press_so(page, api, "frfs.mat")
    assert ("frfs.mat", "succeeded", 2) in counts(api, campaign)
    assert (name, "succeeded", 6) in counts(api, campaign)
    rows = ok(api.get(f"campaigns/{campaign}/records"))["items"]
    assert sorted({(row["force_point"], row["hit"]) for row in rows}) == [
        (4, 1),
        (4, 2),
        (5, 1),
    ]


def frfs_are_chosen(page: Page) -> None:
    page.wait_for_selector("form[data-name='frfs.mat']")
    form_of(page, "frfs.mat").locator("[data-look]").select_option("frfs")
    page.wait_for_selector("form[data-name='frfs.mat'] [name='frf/real']")
    page.select_option("[name=quantity]:visible", "mobility")
    page.select_option("[name='frf/real']", "Hr")
    page.select_option("[name='frf/imaginary']", "Hi")
    fill(page, "", {"response_point": 33, "reference_point": "4, 5", "factor": 2})
    for side in ("response", "reference"):
        page.select_option(f"[name={side}_direction]:visible", "3")


@pytest.mark.long
def test_a_phone_asks_the_same(running: Browser, service: LocalService) -> None:
    """As a desk does above."""
    key = service.new_key("pocket")
    with (
        client_at(service.url, key) as api,
        watched_page(running, service.url, width=390, height=844, dark=True, webgl=False) as seen,
    ):
        campaign = new_campaign(api, {"name": "bar"}, boundary="free")
        page = signed_in(seen, key, f"/ui/campaigns/{campaign}")
        dropped(page, {"long.wav": wav([1.0, 4.0], 7.0), "frfs.mat": mat(f=FREQUENCY, H=VALUES)})
        assert (overflow(seen), hindrances(page)) == (0, [])
