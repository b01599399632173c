"""Coupon batches over HTTP: results in, statistics out."""

from collections.abc import Callable
from typing import Any

import httpx
import pytest

Checked = Callable[[httpx.Response, int], Any]

MODULI = [32.1e9, 33.4e9, 33.0e9, 34.2e9, 32.8e9]


@pytest.fixture
def batch(api: httpx.Client, structure: str, checked: Checked) -> str:
    body = {"name": "0 degrees", "constants": ["Ex", "nu_xy"], "conditions": {"speed": "2 mm/min"}}
    return str(checked(api.post(f"structures/{structure}/coupon-batches", json=body), 201)["id"])


def test_a_batch_of_specimens_in_numbers(api: httpx.Client, structure: str, batch: str, checked: Checked) -> None:
    specimens = [{"specimen": f"A{i}", "E_Pa": e, "nu": 0.15, "failure_code": "lgm"} for i, e in enumerate(MODULI)]
    slipped = {"specimen": "A9", "E_Pa": 20e9, "excluded": True, "exclusion_reason": "slipped in the grip"}
    stored = checked(api.post(f"coupon-batches/{batch}/coupons", json=[*specimens, slipped]), 201)["items"]
    assert [c["failure_code"] for c in stored] == ["LGM"] * 5 + [None]
    summary = checked(api.get(f"coupon-batches/{batch}/summary"), 200)
    # by hand: mean 33.1; deviations -1, .3, -.1, 1.1, -.3; squares sum 2.40; s = sqrt(2.40/4) = .774597
    modulus = summary["constants"]["Ex"]
    assert modulus == summary["properties"]["E_Pa"]
    assert (modulus["n"], modulus["unit"], modulus["source"]) == (5, "Pa", "specimens")
    assert modulus["mean"] == pytest.approx(33.1e9, rel=1e-12)
    assert modulus["standard_deviation"] == pytest.approx(0.6**0.5 * 1e9, rel=1e-9)
    assert modulus["cv_percent"] == pytest.approx(100 * 0.6**0.5 / 33.1, rel=1e-9)
    assert summary["constants"]["nu_xy"]["standard_deviation"] == 0
    assert summary["excluded"] == [{"specimen": "A9", "reason": "slipped in the grip"}]
    assert summary["warnings"] == [
        "nu_xy: no prior: standard_deviation: is 0; specimens that agree to the last digit were not measured"
    ]
    # the next piece of the same material: t with 4 degrees of freedom, s √(1 + 1/5), as in docs/coupons.md
    assert summary["priors"]["Ex"]["standard_deviation"] == pytest.approx(0.6**0.5 * 1e9 * 1.55179, rel=1e-5)
    (listed,) = checked(api.get(f"structures/{structure}/coupon-batches"), 200)["items"]
    assert (listed["coupons"], listed["conditions"]) == (6, {"speed": "2 mm/min"})
    assert checked(api.get(f"coupon-batches/{batch}/coupons"), 200)["items"] == stored


def test_the_key_is_checked_before_the_body(api: httpx.Client, batch: str, checked: Checked) -> None:
    path = f"coupon-batches/{batch}/coupons"
    for body in ({"specimen": "A"}, "nonsense"):
        checked(api.post(path, json=body, headers={"Authorization": ""}), 401)
    checked(api.post(path, files={"file": b""}, headers={"Authorization": "Bearer wrong"}), 401)


def test_a_specimen_is_recorded_once(api: httpx.Client, batch: str, checked: Checked) -> None:
    coupon = {"specimen": "A1", "E_Pa": 33e9}
    checked(api.post(f"coupon-batches/{batch}/coupons", json=coupon), 201)
    checked(api.post(f"coupon-batches/{batch}/coupons", json=[{"specimen": "A2", "nu": 0.1}, coupon]), 409)
    assert len(checked(api.get(f"coupon-batches/{batch}/coupons"), 200)["items"]) == 1
