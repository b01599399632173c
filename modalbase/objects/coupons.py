"""Coupon tests of a structure's material."""

from __future__ import annotations

import json
from io import BytesIO
from pathlib import Path
from typing import Any

from modalbase.client.finding import BATCH
from modalbase.objects.thing import Table, Thing


class CouponBatch(Thing):
    """Coupons of one plate and direction, tested to ASTM D3039 or D3518."""

    noun = BATCH

    def add_curve(self, file: str | Path, *, confirm: bool = False, **about: Any) -> dict[str, Any]:
        """Add a specimen from a testing machine's file.

        Args:
            file: CSV of the machine.
            confirm: take unusual dimensions and results as they are.
            about: `dimensions`, `columns`, and where needed `standard`, `specimen` (by default the file's name) and the
                others of `POST /coupon-batches/{id}/coupons`.

        Raises:
            ClientError: the file cannot be read so; the text says what is missing.
        """
        path = Path(file)
        coupon = {"specimen": path.stem, **about}
        fields = {"coupon": json.dumps(coupon)}
        answer = self.lab.connection.submit(f"{self.address}/coupons", path, fields, confirm=confirm or None)
        made: dict[str, Any] = answer["items"][0]
        return made

    def add_coupon(self, specimen: str, *, confirm: bool = False, **results: Any) -> dict[str, Any]:
        """Add a specimen whose results are known: `E_Pa`, `G_Pa`, `nu`, `strength_Pa`, `standard` and so on; with `confirm`
        unusual ones too.
        """
        body = {"specimen": specimen, **results}
        answer = self.lab.connection.post(f"{self.address}/coupons", body, confirm=confirm or None)
        made: dict[str, Any] = answer["items"][0]
        return made

    def coupons(self) -> Table:
        """Its specimens with their results, SI."""
        return Table(list(self.lab.connection.pages(f"{self.address}/coupons")), key="specimen")

    def summary(self) -> dict[str, Any]:
        """Statistics of the batch, the priors that follow, and warnings."""
        return self.lab.connection.get(f"{self.address}/summary")

    @property
    def statistics(self) -> Table:
        """Mean, standard deviation and coefficient of variation of each constant."""
        return Table([{"name": name, **value} for name, value in self.summary()["constants"].items()])

    def curve(self, specimen: str) -> dict[str, Any]:
        """The raw curve of a specimen as numpy arrays in SI: force in N, strains in m/m, time in s, where it has them."""
        import numpy as np

        content = self.lab.rest.get_curve_data(self.coupons()[specimen]["id"], format="npz")
        with np.load(BytesIO(content)) as arrays:
            return {name: arrays[name] for name in arrays.files}
