"""Areas and lengths of elements, and whether they fold over."""

from __future__ import annotations

import numpy as np

from modalbase.formats.models.model import Elements, Floats

CORNERS = {"quad4": 4, "quad8": 4, "tri3": 3, "tri6": 3, "beam2": 2, "beam3": 2}
"""Corners of elements; of a beam its ends."""


def sizes(block: Elements, places: Floats) -> Floats:
    """(e,) area of shells by their corners, length of beams by their ends."""
    x = places[block.nodes[:, : CORNERS[block.kind]]]
    if block.kind.startswith("beam"):
        return np.asarray(np.linalg.norm(x[:, 1] - x[:, 0], axis=1))
    return np.asarray(np.linalg.norm(normals_of(x), axis=1) / 2)


def normals_of(x: Floats) -> Floats:
    """(e, 3) twice the area along the normal, of (e, n, 3) corners."""
    first, second = (
        (x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]) if x.shape[1] == 3 else (x[:, 2] - x[:, 0], x[:, 3] - x[:, 1])
    )
    return np.asarray(np.cross(first, second))


ALONG_NORMAL = np.cos(np.radians(0.1))
"""An axis lies along a normal from here on (Abaqus and CalculiX)."""


def unit(x: Floats) -> Floats:
    """(e, 3) vectors of length 1 along others; those of no length stay."""
    return np.asarray(x / np.maximum(np.linalg.norm(x, axis=1, keepdims=True), 1e-300))


def axis_without_system(normals: Floats) -> Floats:
    """(e, 3) axis 1 of shells that have none of their own, not projected: x, or z where x is their normal."""
    along = np.abs(normals[:, 0]) > ALONG_NORMAL
    return np.where(along[:, None], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])


def worst_corner(block: Elements, places: Floats) -> Floats:
    """(e,) the least Jacobian at the corners of shells by that of their mean, ≤ 0 where an element folds over.

    The Jacobian is that of the sides' tangents, which those with a node amid bend; of a beam, the least share of its length
    between its nodes.
    """
    n = CORNERS[block.kind]
    x = places[block.nodes]
    middles = x[:, n:] if x.shape[1] > n else None
    if n == 2:
        if middles is None:
            return np.ones(len(x))
        along = x[:, 1] - x[:, 0]
        share = np.einsum("ei,ei->e", middles[:, 0] - x[:, 0], along) / np.einsum("ei,ei->e", along, along)
        return np.asarray(4 * np.minimum(share, 1 - share) - 1)
    normals = normals_of(x[:, :n])
    least = np.full(len(x), np.inf)
    for k in range(n):
        here, after, before = x[:, k], x[:, (k + 1) % n], x[:, k - 1]
        if middles is None:
            out, back = after - here, before - here
        else:
            out = 4 * middles[:, k] - 3 * here - after
            back = 4 * middles[:, k - 1] - 3 * here - before
        least = np.minimum(least, np.einsum("ei,ei->e", np.cross(out, back), normals))
    return np.asarray(least / np.maximum(np.einsum("ei,ei->e", normals, normals), 1e-300))
