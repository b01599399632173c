"""pyOMA-2 on a recording; run by the Python that has it, which need not be ours.

    python benchmarks/peer_pyoma.py recording.npz

The file has `x` (channels, samples), `rate` and `f`, the true frequencies. SSI (covariance-driven,
40 block rows, orders to 60) finds its modes by the clustering that pyOMA-2 names after Reynders.
Where a user clicks, the true frequencies are clicked, and SSI gives the nearest pole of order 60.
JSON goes out: for each, modes as [f, ζ], and processor seconds.
"""

import json
import sys
import time

import numpy as np
from pyoma2.algorithms import SSI  # type: ignore[import-not-found]
from pyoma2.algorithms.data.run_params import Clustering  # type: ignore[import-not-found]
from pyoma2.setup import SingleSetup  # type: ignore[import-not-found]


def main(path: str) -> None:
    """Print what both find."""
    with np.load(path) as file:
        x, rate, f = file["x"], float(file["rate"]), file["f"]
    answer = {}
    begin = time.process_time()
    setup = SingleSetup(x.T, rate)
    ssi = SSI(name="SSI", br=40, ordmax=60, step=2, method="cov")
    setup.add_algorithms(ssi)
    setup.run_by_name("SSI")
    ssi.add_clustering(Clustering(name="judge", quick="Reynders"))
    ssi.run_clustering(name="judge")
    judged = ssi.result.clustering_results["judge"]
    modes = np.column_stack([np.ravel(judged.Fn), np.ravel(judged.Xi)]).tolist()
    answer["SSI, clustered"] = modes, time.process_time() - begin
    answer["SSI, clicked"] = _clicked(setup, "SSI", f, order_in=60), time.process_time() - begin
    sys.stdout.write("\n" + json.dumps(answer))


def _clicked(setup: SingleSetup, name: str, f: np.ndarray, **order: int) -> list[list[float]]:
    modes = []
    for each in f.tolist():
        try:
            setup.mpe(name, sel_freq=[each], **order)
        except Exception:  # noqa: BLE001 - one that it cannot find ends its call
            continue
        pole = [
            float(np.ravel(value)[0]) for value in (setup[name].result.Fn, setup[name].result.Xi)
        ]
        if np.isfinite(pole).all():
            modes.append(pole)
    return modes


if __name__ == "__main__":
    main(sys.argv[1])
