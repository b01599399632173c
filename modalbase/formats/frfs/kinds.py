"""What FRFs are by the words of a file, where no unit says it: "Mobility", "H1 Velocity / Force"."""

import re
from collections.abc import Iterable

from modalbase.formats.errors import FormatError
from modalbase.formats.types import Quantity

_OVER_FORCE = r"\s*(?:/|per|over|pro)\s*(?:force|kraft)"
_WORDS: dict[Quantity | None, str] = {
    "accelerance": rf"accelerance|inertance|acceleration{_OVER_FORCE}|beschleunigung{_OVER_FORCE}",
    "mobility": rf"mobility|mobilität|mobilité|velocity{_OVER_FORCE}|geschwindigkeit{_OVER_FORCE}",
    "receptance": rf"receptance|rezeptanz|compliance|displacement{_OVER_FORCE}|weg{_OVER_FORCE}",
    None: r"(?:mechanical|point|driving[- ]point|mechanische) (?:impedance|impedanz)"
    r"|(?:apparent|dynamic|dynamische) mass?e?|dynamic stiffness|dynamische steifigkeit"
    r"|force\s*/\s*(?:acceleration|velocity|displacement)|transmissibility",
}
"""None: what is no response over a force."""
_KINDS = {
    kind: re.compile(rf"(?<![^\W_])(?:{words})(?![^\W_])", re.IGNORECASE)
    for kind, words in _WORDS.items()
}


def kinds_in(texts: Iterable[str]) -> dict[Quantity | None, str]:
    """What texts call FRFs, each with the first word for it.

    >>> kinds_in(["Signal: H1 Velocity / Force", "Apparent mass"])
    {'mobility': 'Velocity / Force', None: 'Apparent mass'}
    """
    return {
        kind: match[0]
        for kind, words in _KINDS.items()
        if (match := next(filter(None, map(words.search, texts)), None)) is not None
    }


def kind_by_words(texts: Iterable[str], stated: Quantity | None) -> Quantity | None:
    """What FRFs are that no unit states, by what is stated beside the file or by its words.

    Raises:
        FormatError: these differ, or FRFs are no responses over a force.
    """
    known = kinds_in(list(texts))
    if not known or (stated in known and stated is not None):
        return stated
    kind, word = next(iter(known.items()))
    if kind is None:
        raise FormatError(
            "quantity",
            f"is said by the file to be {word!r}, which is no response over a force; export a"
            " receptance, mobility or accelerance, or state `unit` in the mapping where it is one",
        )
    if stated not in (None, kind):
        raise FormatError(
            "quantity",
            f"is {stated}, and the file says {word!r}, a {kind}; state the one that is right, or"
            f" `unit` in the mapping",
        )
    return stated or (kind if len(known) == 1 else None)
