"""From a hammer's time blocks to elastic constants and damping: one request, one job."""

import httpx
import numpy as np

from tests.golden.inputs import hits_campaign, open_file, truth_of
from tests.support.rest import finished, ok, posted, result_of

WITHIN = {"Ex": 0.01, "Gxy": 0.02, "a0": 0.02, "a1": 0.03}


def test_time_blocks_become_parameters_in_one_job(api: httpx.Client) -> None:
    """Of a free beam whose blocks were multiplied with an exponential window, which damps like the body."""
    campaign, truth = hits_campaign(api, "hits-free-window"), truth_of(open_file("hits-free-window/hits.npz"))
    job = f"update-jobs/{posted(api, f'campaigns/{campaign}/update-jobs', {})['id']}"
    assert finished(api, job)["status"] == "succeeded"
    result = result_of(api, job)
    found = {p["name"]: p for p in result["parameters"]}
    for parameter, share in WITHIN.items():
        true = truth["config"][parameter]
        low, high = found[parameter]["interval_95"]
        assert abs(found[parameter]["estimate"] / true - 1) < share, parameter
        assert low <= true <= high, parameter
    frfs = ok(api.get(f"campaigns/{campaign}/frfs"))["items"]
    assert {f["id"] for f in frfs} == {f["id"] for f in result["provenance"]["frfs"]}
    rates = {f["window_rate_per_s"] for f in frfs}
    assert rates == {truth["instruments"]["window_rate_per_s"]}
    judged = ok(api.get(f"processings/{result['provenance']['processing']}"))["result"]["hits"]
    assert len(judged) == len(truth["records"])
    faults = np.array([record["fault"] is not None for record in truth["records"]])
    accepted = np.array([hit["accepted"] for hit in judged])
    assert np.mean(accepted[~faults]) > 0.95
