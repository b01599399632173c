"""What every reader of decks checks of the model that it made."""

from __future__ import annotations

import numpy as np
import scipy

from modalbase.formats.errors import FormatError
from modalbase.formats.models.model import FiniteElementModel, Integers


def check_joined(model: FiniteElementModel) -> None:
    """Check that all elements hang together, or are held.

    Raises:
        FormatError: elements are joined to the rest by no node, link or spring, and nothing holds them.
    """
    parts = _parts(model)
    used = np.unique(np.concatenate([block.nodes.ravel() for block in model.elements]))
    held = {int(part) for support in model.supports for part in parts[support.nodes]}
    held |= {int(parts[spring.node]) for spring in model.springs if spring.second is None}
    sizes = np.bincount(parts[used], minlength=int(parts.max()) + 1)
    free = [part for part in np.argsort(-sizes)[1:].tolist() if sizes[part] and part not in held]
    if not free:
        return
    first = min((int(block.lines[at]), int(block.numbers[at]), block.set) for block in model.elements
                for at in np.flatnonzero(parts[block.nodes[:, 0]] == free[0])[:1])  # fmt: skip
    others = f" (and {len(free) - 1} further parts)" if len(free) > 1 else ""
    raise FormatError(
        f"line {first[0]}",
        f"element {first[1]} of {first[2]} belongs to a part of {sizes[free[0]]} grids that nothing joins to the rest or holds"
        f"{others}; merge coincident nodes, or leave it out",
    )


def _parts(model: FiniteElementModel) -> Integers:
    """(n,) which part each node belongs to."""
    pairs = [np.column_stack([np.repeat(block.nodes[:, :1], block.nodes.shape[1] - 1, axis=1).ravel(),
                              block.nodes[:, 1:].ravel()]) for block in model.elements]  # fmt: skip
    joined = [(link.node, leader) for link in model.links for leader in link.leaders]
    joined += [(spring.node, spring.second) for spring in model.springs if spring.second is not None]
    pairs.append(np.array(joined, dtype=np.int64).reshape(-1, 2))
    first, second = np.vstack(pairs).T
    size = len(model.nodes)
    graph = scipy.sparse.coo_array((np.ones(len(first)), (first, second)), shape=(size, size))
    _, parts = scipy.sparse.csgraph.connected_components(graph, directed=False)
    return np.asarray(parts, dtype=np.int64)
