"""One material from two tests: the source paper's bar, clamped and hung freely, as one joint update
of a running service.

python -m examples.joint_update
"""

import time
from typing import Any

import modalbase
from examples.paper.published import (
    DENSITY,
    FREE_LENGTH,
    FREE_MEASURED_HZ,
    POISSON,
    TABLE_3_MEASURED_HZ,
    TABLE_4_COUPONS,
)

MATERIAL = {
    **{f"{name}_Pa": value for name, value in TABLE_4_COUPONS.items()},
    "Gxz_Pa": 4.5e9,
    "Gyz_Pa": 4.5e9,
    "nu_xy": POISSON,
}
EXACT = {"thickness_sd_m": 0, "width_sd_m": 0, "density_sd_kg_m3": 0, "fibre_angle_sd_deg": 0}


def paper_bar_together(lab: modalbase.Laboratory) -> dict[str, Any]:
    """Store the two tests where they are not there yet, update them together, and give the result's
    document.
    """
    project = lab.project("one bar, two tests", create=True)
    size = {"width_m": 0.04, "thickness_m": 0.01012, "density_kg_m3": DENSITY}
    jobs = []
    tests = (("cantilever", 0.5, TABLE_3_MEASURED_HZ), ("free", FREE_LENGTH, FREE_MEASURED_HZ))
    for boundary, length, measured in tests:
        bar = project.structure(
            f"bar, {boundary}", create=True, length_m=length, **size, **MATERIAL
        )
        campaign = bar.campaign(boundary, create=True, boundary=boundary)
        modes = campaign.mode_set(
            "Table 3", create=True, modes=[{"frequency_hz": hz} for hz in measured]
        )
        # The same bar: both campaigns are of the specimen `bar`, though its vibrating lengths
        # differ.
        recipe = {"mode_set": modes.id, "inputs": EXACT}
        jobs.append({"campaign_id": campaign.id, "specimen": "bar", "recipe": recipe})
    parameters = [{"name": name} for name in ("Ex", "Ey", "Gxy", "Gxz", "Gyz")]
    body = {"joint": True, "jobs": jobs, "recipe": {"parameters": parameters}}
    joint = lab.rest.start_updates(body=body)["joint"]
    while (state := lab.rest.get_joint_update(joint["id"]))["status"] in ("queued", "running"):
        time.sleep(0.2)
    if state["status"] != "succeeded":
        raise RuntimeError(f"the joint update {state['status']}: {state['message']}")
    document: dict[str, Any] = lab.rest.get_joint_result(joint["id"])
    return document


def main() -> None:
    """Run it against the service that is found and print what came of it."""
    with modalbase.connect() as lab:
        result = paper_bar_together(lab)
    print(result["verdict"]["sentence"])
    for part in result["campaigns"]:
        alone = part["alone"]["Ex"]
        print(
            f"{part['name']}: alone Ex {alone['estimate'] / 1e9:.2f} GPa (z {alone['z']:+.1f}), p"
            f" {part['predictive_p']:.2g}"
        )
        for own in part["own"]:
            low, high = own["interval_95"]
            print(f"  {own['name']} {own['estimate']:.4g} ({low:.4g} to {high:.4g}) {own['unit']}")


if __name__ == "__main__":
    main()
