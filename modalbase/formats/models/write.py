"""Updated numbers put back into the user's own deck, in which nothing else changes.

Each changes where it stands, with a comment above its line. Where sets shared a material that now
differs, copies of it are appended, and the sections name those. Every other byte stays.
"""

from collections.abc import Callable, Mapping, Sequence

from modalbase.formats.models.bdf.write import BdfWriting
from modalbase.formats.models.changes import Writing, changes_of
from modalbase.formats.models.inp.write import InpWriting
from modalbase.formats.models.model import FiniteElementModel

WRITTEN: dict[str, Callable[[bytes, FiniteElementModel, Mapping[str, bytes]], Writing]] = {
    "inp": InpWriting,
    "bdf": BdfWriting,
}
"""What changes the files of a deck, by format of its model."""


def write_deck(
    content: bytes,
    model: FiniteElementModel,
    updated: Mapping[tuple[str, str], float],
    *,
    included: Mapping[str, bytes] | None = None,
    remarks: Sequence[str] = (),
) -> dict[str, bytes]:
    """The files of a deck that change by an update, by name; the deck's own is empty.

    Args:
        content: the deck as it was read.
        model: what it was read to, in its own units.
        updated: new values by set and constant, in the deck's units: `E1`, `E2`, `G12`, `G13`,
            `G23`, `nu12`, or `E`, `nu`, `G` of an isotropic material; of a second material of the
            stack, from the bottom, `E1_2` and so on; `density` of the set, `t` of its whole
            thickness, `factor` of all moduli; of beams also `area`, `I1`, `I2`, `J`.
        included: files that the deck includes, by name.
        remarks: lines of comment for the deck's head.

    Raises:
        FormatError: a set or constant is none of the deck's, a value is not a number, it does not
            stand there as a number of its own, or its card stands in a file that is not here.
    """
    return WRITTEN[model.format](content, model, included or {}).write(
        changes_of(model, updated), remarks
    )
