"""Cards of a deck and their data lines, with the files that it includes put in their place; and
what is lost without them.
"""

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from modalbase.formats.errors import FormatError
from modalbase.formats.foreign import require_text
from modalbase.formats.models import model
from modalbase.formats.models.files import DEEPEST_INCLUDE, included_file, lines_of
from modalbase.formats.models.model import LARGEST, FieldPlace, Where

MOST_LINES = 2_000_000
MOST_READINGS = 20
"""Lines that are read, in all and by those that were sent: what files include again and again is no
work without end.
"""

_SPACE = re.compile(r"\s+")
_INCLUDE = re.compile(r"\s*\*\s*INCLUDE\s*(,|$)", re.IGNORECASE)
_FORTRAN = re.compile(r"([0-9.])[dD]([-+]?[0-9])")
_DATA = re.compile(r"(^|,)\s*[-+.\d][-+.\w]*\s*(,|$)")
_PARAMETER = re.compile(r'((?:[^,"]|"[^"]*"?)*)(?:,|$)')


def squeezed(name: str) -> str:
    """A name of a card or parameter as it is compared: capitals without spaces, as `*Shell Section`
    and `*SHELLSECTION`.
    """
    return _SPACE.sub("", name).upper()


def card_names(text: str) -> frozenset[str]:
    """Squeezed names of cards, separated by spaces."""
    return frozenset(text.split())


def folded(name: str) -> str:
    """A name that the user gave, as it is compared: without quotes, capitals and spaces around
    it.
    """
    return name.strip().strip('"').strip().lower()


@dataclass(frozen=True)
class DataLine:
    """A data line."""

    card: str  # name of the card that it belongs to, for messages
    text: str  # without the end of the line
    where: Where
    # whether an empty line is before it, which says that what could stand there is left out
    after_blank: bool = False

    def error(self, message: str) -> FormatError:
        """A fault of this line."""
        return fault(self.where, self.card, message)

    @property
    def fields(self) -> list[str]:
        """Texts between commas; empty ones at the end are left out."""
        texts = [text.strip() for text in self.text.split(",")]
        while texts and not texts[-1]:
            texts.pop()
        return texts

    @property
    def name_and_rest(self) -> tuple[str, list[str]]:
        """The first field, and those behind it.

        Raises:
            FormatError: the line has commas alone.
        """
        if not (fields := self.fields):
            raise self.error("has no field, expected at least one")
        return fields[0], fields[1:]

    def place(self, column: int) -> FieldPlace:
        """Where a field stands."""
        start = 0
        for text in self.text.split(",")[:column]:
            start += len(text) + 1
        return FieldPlace(
            self.where.line, start, start + len(self.text[start:].split(",", 1)[0]), self.where.file
        )

    def number(self, text: str, what: str) -> float:
        """A finite number."""
        try:
            value = float(_FORTRAN.sub(r"\1e\2", text))
        except ValueError:
            value = math.nan
        if not abs(value) < LARGEST or "_" in text:
            raise self.error(f"{what} is {text[:40]!r}, expected a number below {LARGEST:g}")
        return value

    def whole(self, text: str, what: str) -> int:
        """A whole number that fits 9 digits, as both solvers ask."""
        if not text.lstrip("+-").isdecimal() or not text.isascii() or len(text) > 11:
            raise self.error(
                f"{what} is {text[:40]!r}, expected a whole number of at most 9 digits"
            )
        value = int(text)
        if abs(value) > 999_999_999:
            raise self.error(f"{what} is {text}, expected a whole number of at most 9 digits")
        return value

    def numbers(self, what: str, least: int = 1) -> list[float]:
        """All fields as numbers, empty ones as 0."""
        fields = self.fields
        if len(fields) < least:
            raise self.error(f"has {len(fields)} fields, expected at least {least}: {what}")
        return [
            self.number(text or "0", f"field {k} ({what})")
            for k, text in enumerate(fields, start=1)
        ]


@dataclass(frozen=True)
class Keyword:
    """A keyword and its data lines, called a card."""

    name: str  # squeezed, without the star
    label: str  # as the user wrote it, with the star
    parameters: Mapping[str, str]  # by squeezed name; empty where they have no value
    where: Where
    rows: list[DataLine] = field(default_factory=list)  # its data lines

    def error(self, message: str) -> FormatError:
        """A fault of this card."""
        return fault(self.where, self.label, message)

    def get(self, parameter: str) -> str:
        """A parameter's value, empty where it is not given."""
        return self.parameters.get(squeezed(parameter), "")

    def needs(self, parameter: str) -> str:
        """A parameter's value.

        Raises:
            FormatError: it is missing.
        """
        if not (value := self.get(parameter)):
            raise self.error(f"has no {parameter}=, which says what it belongs to")
        return value

    def number(self, text: str, what: str) -> float:
        """A parameter as a finite number."""
        return DataLine(self.label, text, self.where).number(text, what)

    @property
    def first(self) -> DataLine:
        """The first data line.

        Raises:
            FormatError: there is none.
        """
        if not self.rows:
            raise self.error("has no data line behind it; is the file cut?")
        return self.rows[0]


def fault(where: Where, card: str, message: str) -> FormatError:
    """A fault at a line of a card."""
    return FormatError(str(where), f"{card} {message}")


def read_cards(content: bytes, included: Mapping[str, bytes]) -> list[Keyword]:
    """All cards in their order; those of included files stand where *INCLUDE does.

    Raises:
        FormatError: the file is no deck, a line is broken, or an included file is missing or
            includes itself.
    """
    require_text(content[:4096], "a deck of Abaqus or CalculiX, text with cards such as *NODE")
    cards = list(_cards(_Files(content, included).lines(content)))
    if not cards:
        raise FormatError(
            "",
            "the file has no card such as *NODE or *ELEMENT; it is no deck of Abaqus or CalculiX",
        )
    for card in cards:
        if card.get("INPUT"):
            raise card.error(
                f"reads its lines from {card.get('INPUT')}; put them there by *INCLUDE"
            )
    return cards


class _Line(NamedTuple):
    """A line of a file, without the blanks at its end."""

    where: Where
    text: str


class _Files:
    """A deck and the files that it includes, which may be read several times, so that their lines
    are counted.
    """

    def __init__(self, content: bytes, included: Mapping[str, bytes]) -> None:
        self._included = included
        self._lines = 0
        sent = sum(text.count(b"\n") + 1 for text in (content, *included.values()))
        self._most = min(MOST_LINES, MOST_READINGS * sent)

    def lines(self, content: bytes, within: tuple[str, ...] = ()) -> Iterator[_Line]:
        """Lines of a file with those of the files that it includes in their place; `within` names
        what leads to it.
        """
        file = within[-1] if within else ""
        text = lines_of(content)
        self._lines += len(text)
        if self._lines > self._most:
            raise FormatError(
                file,
                f"the deck has more than {self._most} lines with what it includes: at most"
                f" {MOST_LINES} are read, and {MOST_READINGS} times what was sent",
            )
        for line in _continued(text, file):
            if _INCLUDE.match(line.text):
                name = self._named(_card(line), within)
                yield from self.lines(self._included[name], (*within, name))
            else:
                yield line

    def _named(self, card: Keyword, within: tuple[str, ...]) -> str:
        """The included file that a card means, by its path or the last part of it."""
        name = card.needs("INPUT").strip('"')
        if (match := included_file(name, self._included)) is None:
            raise card.error(f"names {name!r}, which was not handed in; give that file too")
        if match in within:
            raise card.error(f"of {name!r} goes in a circle: {' → '.join((*within, match))}")
        if len(within) >= DEEPEST_INCLUDE:
            raise card.error(
                f"of {name!r} lies more than {DEEPEST_INCLUDE} files deep, which is the most that"
                " is read"
            )
        return match


def _continued(texts: list[str], file: str) -> Iterator[_Line]:
    """Lines of a file, a card's with those that continue it as one.

    Parameters go on behind a comma at the end of the line. CalculiX lets the comma stand before
    data too, which have a number.
    """
    begun: _Line | None = None
    for number, raw in enumerate(texts, start=1):
        line = _Line(Where(number, file), raw.rstrip())
        text = line.text.lstrip()
        if begun is not None and text.startswith("**"):
            continue
        if begun is not None and text and not text.startswith("*") and not _DATA.search(text):
            line = _Line(begun.where, begun.text + text)
        elif begun is not None:
            yield begun
        begun = line if line.text.endswith(",") and re.match(r"\s*\*[^*]", line.text) else None
        if begun is None:
            yield line
    if begun is not None:
        yield begun


def _cards(lines: Iterator[_Line]) -> Iterator[Keyword]:
    """Cards of lines."""
    card: Keyword | None = None
    blank = False
    for line in lines:
        text = line.text.lstrip()
        if text.startswith("**") or not text:
            blank = not text
            continue
        if text.startswith("*"):
            if card is not None:
                yield card
            card = _card(line)
        elif card is None:
            raise fault(line.where, "the data line", f"{line.text[:40]!r} stands before any card")
        else:
            card.rows.append(DataLine(card.label, line.text, line.where, blank))
        blank = False
    if card is not None:
        yield card


def _card(line: _Line) -> Keyword:
    """A card of its line."""
    label, *parts = (match.group(1) for match in _PARAMETER.finditer(line.text.strip()))
    parameters = {}
    for part in parts:
        name, _, value = part.partition("=")
        if name.strip():
            parameters[squeezed(name)] = value.strip()
    return Keyword(squeezed(label[1:]), label.strip(), parameters, line.where)


_HARMLESS = {
    "requests for output": (
        "OUTPUT NODEOUTPUT ELEMENTOUTPUT ENERGYOUTPUT CONTACTOUTPUT INTEGRATEDOUTPUT"
        " INTEGRATEDOUTPUTSECTION MODALOUTPUT MODALFILE NODEPRINT ELPRINT NODEFILE ELFILE"
        " CONTACTFILE CONTACTPRINT ENERGYPRINT ENERGYFILE FACEPRINT FILEOUTPUT FILEFORMAT PREPRINT"
        " PRINT RESTART MONITOR SECTIONPRINT SECTIONFILE TIMEPOINTS NODEOUT FILTER"
        " ELEMENTMATRIXOUTPUT MATRIXGENERATE MATRIXOUTPUT SURFACEPROPERTY WAVEFRONTMINIMIZATION"
        " FILE RESULTSFILE SURFACESECTION"
    ),
    "loads: modes have none": (
        "CLOAD DLOAD DSLOAD AMPLITUDE TEMPERATURE FIELD CFLUX DFLUX DSFLUX FILM SFILM RADIATE"
        " SRADIATE BASEMOTION BASELINECORRECTION INERTIARELIEF PHYSICALCONSTANTS INITIALCONDITIONS"
        " PSDDEFINITION CORRELATION LOADCASE SURFACELOAD BOUNDARYF MASSFLOW DEFINEPLATE SPECTRUM"
        " PREDEFINEDFIELD"
    ),
    "steps other than those of modes": (
        "STATIC DYNAMIC BUCKLE STEADYSTATEDYNAMICS MODALDYNAMIC HEATTRANSFER VISCO COMPLEXFREQUENCY"
        " SELECTEIGENMODES CONTROLS COUPLEDTEMPERATUREDISPLACEMENT COUPLEDTEMPERATURE-DISPLACEMENT"
        " UNCOUPLEDTEMPERATURE-DISPLACEMENT RANDOMRESPONSE RESPONSESPECTRUM SOLVERCONTROLS"
        " SUBSTRUCTUREGENERATE SENSITIVITY OBJECTIVE DESIGNVARIABLES GREEN ELECTROMAGNETICS"
        " STEADYSTATETRANSPORT ANNEAL CRACKPROPAGATION DIRECTCYCLIC GEOSTATIC CFD"
    ),
    "damping: it is measured": (
        "MODALDAMPING GLOBALDAMPING DASHPOT DAMPING CONTACTDAMPING DAMPINGCONTROLS VISCOUS"
    ),
    "heat": (
        "EXPANSION CONDUCTIVITY SPECIFICHEAT LATENTHEAT ELECTRICALCONDUCTIVITY MAGNETICPERMEABILITY"
        " GAPCONDUCTANCE FLUIDCONSTANTS SPECIFICGASCONSTANT GAPHEATGENERATION FLUIDSECTION"
        " DISTRIBUTIONTABLE"
    ),
    "what a material does beyond small motions": (
        "PLASTIC CREEP CYCLICHARDENING FAILSTRESS FAILSTRAIN DAMAGEINITIATION DAMAGEEVOLUTION"
        " DAMAGESTABILIZATION DEPVAR VISCOELASTIC DEFORMATIONPLASTICITY RATEDEPENDENT"
        " USEROUTPUTVARIABLES POTENTIAL MOHRCOULOMB MOHRCOULOMBHARDENING DRUCKERPRAGER"
        " COMPRESSIVEFAILURE CONCRETEDAMAGEDPLASTICITY FRACTURECRITERION"
    ),
    "properties of contact": (
        "SURFACEINTERACTION SURFACEBEHAVIOR FRICTION CHANGEFRICTION CHANGESURFACEBEHAVIOR"
        " CHANGECONTACTTYPE CONTACTCONTROLS CONTACTINITIALIZATIONASSIGNMENT"
        " CONTACTINITIALIZATIONDATA CONTACTPROPERTYASSIGNMENT CONTACTINCLUSIONS CONTACTEXCLUSIONS"
        " CONTACTFORMULATION CONTACTSTABILIZATION CLEARANCE SURFACEPROPERTYASSIGNMENT"
        " COHESIVEBEHAVIOR"
    ),
    "controls of elements": "SECTIONCONTROLS HOURGLASSSTIFFNESS ENRICHMENT",
    "names": "HEADING SURFACE DISTRIBUTION MEMBRANE VALUESATINFINITY",
}
_CHANGES = {
    "contact: what touches is not joined": "CONTACT CONTACTPAIR GAP GAPELEMENT TIEDCONTACT",
    "normals of their own: those of the mesh are taken": "NORMAL",
    "the transverse shear stiffness: that of the material is taken": (
        "TRANSVERSESHEARSTIFFNESS TRANSVERSESHEAR"
    ),
    "joints between nodes": (
        "CONNECTORSECTION CONNECTORELASTICITY CONNECTORBEHAVIOR CONNECTORDAMPING CONNECTORMOTION"
        " FASTENER FASTENERPROPERTY JOINT JOINTELASTICITY BEAMSECTIONOFFSET RELEASE"
    ),
    "a constraint": (
        "EMBEDDEDELEMENT SHELLTOSOLIDCOUPLING CYCLICSYMMETRYMODEL PRETENSIONSECTION"
        " PRE-TENSIONSECTION DISPLAYBODY MULTIPOINTCONSTRAINT TRUSSSECTION ELEMENTTIE NETWORKMPC"
        " SUBMODEL"
    ),
    "reinforcement": "REBARLAYER REBAR EMBEDDEDREGION",
    "a change of shape or of what is there": (
        "IMPERFECTION MODELCHANGE MASSADJUST MASSSCALING FIXEDMASSSCALING"
    ),
    "stiffness or mass given by numbers": (
        "MATRIXINPUT MATRIXASSEMBLE USERELEMENT UELPROPERTY MATRIX SUBSTRUCTUREPROPERTY"
        " SUBSTRUCTUREPATH NONSTRUCTURALMASS ADDEDMASS POINTMASS SOLIDSECTION MEMBRANESECTION"
    ),
}
_KNOWN = {name: (loss, False) for loss, names in _HARMLESS.items() for name in names.split()}
_KNOWN |= {name: (loss, True) for loss, names in _CHANGES.items() for name in names.split()}


class InpReport(model.ReadReport):
    """Cards that were not used, under the names that the user wrote."""

    def note(self, where: Keyword | DataLine, kind: str, **values: object) -> None:
        """Note a card, or a line of one, with what is lost by its row of `LOSSES`."""
        label = where.label if isinstance(where, Keyword) else where.card
        self.add(where, kind, label.upper(), **values)

    def lost(self, where: Keyword | DataLine, what: str, changes: bool) -> None:
        """Note a card, or a line of one, that a table has as not used."""
        self.note(where, "keyword_left_out" if changes else "keyword_not_used", what=what)

    def unused(self, card: Keyword) -> None:
        """Note a card by what is known of it; one that is unknown may change modes."""
        if card.name == "INITIALCONDITIONS" and card.get("TYPE").upper() == "STRESS":
            self.note(card, "initial_stress")
        elif card.name in _KNOWN:
            self.lost(card, *_KNOWN[card.name])
        else:
            self.note(card, "keyword_unknown")
