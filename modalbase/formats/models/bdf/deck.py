"""A deck: which sets its case control holds, the names of sets, its cards, and what all readers of
them need; and what is lost with the cards that none of them took.

Names are those of the comments that pre-processors write, safe as names of parameters.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from modalbase.formats.errors import FormatError
from modalbase.formats.models.bdf.card import Card, cards_of, numbered
from modalbase.formats.models.bdf.frames import Grids, read_grids
from modalbase.formats.models.bdf.lines import Line, split_deck
from modalbase.formats.models.bdf.materials import BdfMaterials
from modalbase.formats.models.model import ReadReport, Where
from modalbase.formats.uff.text import decoded

_SOLIDS = frozenset(
    (
        "CHEXA",
        "CTETRA",
        "CPENTA",
        "CPYRAM",
        "CPYRA",
        "CHEXA8",
        "CHEXA20",
        "CHEX8",
        "CHEX20",
        "CIHEX1",
    )
)

_HARMLESS: tuple[tuple[str, str], ...] = (
    (r"CORD[123][RCS]|GRDSET|BAROR|BEAMOR|MAT\d+|P(SHELL|COMPG?|BARL?|BEAML?|ROD|TUBE|ELAST?|BUSHT?|MASS)", ""),
    (r"EIGRL?|EIGC|EIGB|EIGP", "the request for modes"),
    (r"FORCE[12]?|MOMENT[12]?|P?LOAD.*|PLOAD[1245X]*|GRAV|RFORCE.*|SLOAD|ACCEL.*|CLOAD|LSEQ", "static loads"),
    (r"[RT]LOAD[12]|DAREA|DLOAD|DELAY|DPHASE|FREQ\d?|TSTEP.*|TIC|TF|NOLIN\d|RANDPS|RANDT1|SPCD", "dynamic loads"),
    (r"TABLE.*|TABRND.*|TABDMP1", "tables of loads and damping"),
    (r"TEMP.*|DEFORM|QBDY\d|CHBDY.*|CONV.*|PCONV.*|RADM|RADBC|RADSET|VIEW.*|QVOL|QHBDY|PHBDY|SPCT.*", "temperatures"),
    (r"C?DAMP\d|PDAMP.*|CVISC|PVISC|CDAMP.*", "dampers; frequencies of undamped modes stay"),
    (
        r"AERO[SFZ0]?.*|[CP]AERO.*|SPLINE.*|SET[123]|FLFACT|FLUTTER|MKAERO.*|TRIM.*|AE[A-Z]+\d?|CSSCHD|DIVERG|GUST"
        r"|DMIJI?|DMIK|MON.*|PAFOIL.*|ATTACH|PANLST.*|BODY7|SEGMESH|VFACT|MKAEROZ|UXVEC",
        "aeroelastic data",
    ),
    (r"DVPREL.*|DVMREL.*|DVCREL.*|DESVAR|DCONSTR|DCONADD|DRESP.*|DEQATN|DOPTPRM|DLINK|DSCREEN|DVGRID|DTABLE|DVSET"
     r"|DVBSHAP|DSHUFF|DTPL|TOPVAR|BNDGRID", "optimisation"),
    (r"SUPORT1?|USET1?|PLOTEL\d?|POINT|GEOMCHECK|MDLPRM|ECHOO?N?O?F?F?|NASTRAN|DTI|DMI|DMIAX|FLUTTER|BEGIN|PSOLID|PLSOLID"
     r"|NLPARM|TSTEPNL|NLPCI|NLSTEP|BCPARA|BSURFS?|BCPROPS?|MATF|OUTRCV|PLPLANE|CBARAO|LABEL|SEQGP|DPHSE|PARAMARM"
     r"|UNGLUE|MODTRAK|GRIDF|CYSYM|SWLDPRM|HYBDAMP|CAMPBLL|ROTOR.*|RSPIN.*|RGYRO", "data that modes do not need"),
)  # fmt: skip
_CHANGING: tuple[tuple[str, str], ...] = (
    (r"ASET1?|OMIT1?|QSET1?|BSET.*|CSET.*|DYNRED|SESET|SEBSET1?|SEQSET1?|SECSET1?", "a reduction to chosen dofs"),
    (r"CGAP|PGAP|BCTABLE|BCONTACT|BCBODY1?|BCTSET|BCTPARM|CONTACT", "gaps and contact"),
    (r"BGSET|BGPARM|BGADD", "glued contact, which joins parts"),
    (r"C(FAST|WELD|SEAM)|P(FAST|WELD|SEAM)|BOLT.*", "fasteners, which join parts"),
    (r"MATT\d+|MATS\d+|CREEP", "a material that varies with temperature or stress"),
    (r"CSHEAR|PSHEAR", "shear panels"),
    (r"CMASS\d|PMASS|CONM1", "masses at single dofs"),
    (r"[SE]POINT.*|CELAS[34]", "scalar points"),
    (r"RROD|RTRPLT1?|RSPLINE|RSSCON|RJOINT|RBAR1", "a rigid element"),
    (r"CBEAM3|PBEAM3|CBEND|PBEND|CQUADX\d?|CTRIAX\d?|CTRAX.*|CCON.*|PCONEAX|CRAC.*|CQUAD|CPLST.*|CPLSTN.*|CROT.*",
     "elements of a kind that is not read"),
    (r"GENEL", "a stiffness matrix"),
    (r"SE[A-Z]+|RELEASE|CSUPER|CSUPEXT|EXTRN", "superelements"),
    (r"PLOTEL3", "elements of a kind that is not read"),
)  # fmt: skip
_TABLE = [
    (re.compile(pattern), loss, changes)
    for table, changes in ((_HARMLESS, False), (_CHANGING, True))
    for pattern, loss in table
]
_STIFFENED_DRILLING = 100.0  # K6ROT that Nastran itself takes


def note_unread(deck: BdfDeck) -> None:
    """Note cards that change modes and that no reader takes, before what they may leave incomplete
    is read.
    """
    _note(
        deck,
        [
            name
            for name in deck.cards
            if any(changes and of.fullmatch(name) for of, _, changes in _TABLE)
        ],
    )


def note_unused(deck: BdfDeck) -> None:
    """Note cards that no reader took."""
    _note(deck, list(deck.cards))


def _note(deck: BdfDeck, names: Iterable[str]) -> None:
    for name in names:
        kind, what = _loss(name)
        for card in deck.take(name):
            if what is not None:
                deck.notes.add(card, kind, name, what=what)


def refuse_solids(cards: Mapping[str, Sequence[Card]]) -> None:
    """Refuse a deck with solid elements.

    Raises:
        FormatError: it has some; the message says which way is open.
    """
    for name in _SOLIDS & set(cards):
        first = cards[name][0]
        raise FormatError(
            str(first.where),
            f"{name}: solid elements are not read. Let Nastran export the model's matrices (DMIG"
            " punch: EXTSEOUT(DMIGPCH), or PARAM,EXTOUT,DMIGPCH) and send these",
        )


def _loss(name: str) -> tuple[str, str | None]:
    """Kind of loss of a card that is not used, and what it states; None where nothing is lost."""
    for pattern, what, changes in _TABLE:
        if pattern.fullmatch(name):
            return "card_left_out" if changes else "card_not_used", what or None
    return "card_unknown", ""


def note_params(cards: Iterable[Card], notes: ReadReport) -> None:
    """Note PARAM cards; WTMASS is used elsewhere."""
    for card in cards:
        name = card.text(0)
        if name == "K6ROT" and card.text(1) and card.real(1, "V1") > _STIFFENED_DRILLING:
            notes.add(card, "k6rot")
        elif name not in ("WTMASS", ""):
            notes.add(card, "param")


_ORDER = re.compile(r"\s*([A-Z0-9]+)\s*(?:\([^)]*\))?\s*=\s*(.*?)\s*$")
_SELECTORS = (
    "SPC",
    "MPC",
    "NSM",
    "METHOD",
    "K2GG",
    "M2GG",
    "B2GG",
    "K2PP",
    "M2PP",
    "STATSUB",
    "TEMPERATURE",
    "A2GG",
)


@dataclass
class Case:
    """What the subcase of the modes selects."""

    # whether there is any case control; a deck of bulk data alone selects nothing
    is_stated: bool = False
    title: str = ""  # of the deck
    # sets by the name of the order, such as `SPC`
    selected: dict[str, str] = field(default_factory=dict)
    # other sets of the same kind that further subcases select, with the line
    others: dict[str, list[tuple[str, Where]]] = field(default_factory=dict)
    places: dict[str, Where] = field(default_factory=dict)  # where the selected sets are named
    params: list[Line] = field(default_factory=list)  # lines PARAM of the case control

    def number(self, order: str) -> int | None:
        """The set that an order selects."""
        text = self.selected.get(order, "")
        return int(text) if text.isdecimal() and text.isascii() and len(text) < 12 else None


def read_case(lines: Sequence[Line]) -> Case:
    """The case control of the lines before BEGIN BULK.

    Orders above the first subcase hold in all. Of several subcases the first with a METHOD of its
    own is taken, else the first; what others select instead is noted.
    """
    control = Case(is_stated=bool(lines))
    common: dict[str, tuple[str, Where]] = {}
    subcases: list[dict[str, tuple[str, Where]]] = []
    for line in lines:
        text = line.text
        if text.lstrip().startswith("SUBCASE"):
            subcases.append({})
            continue
        if text.replace(",", " ").split(None, 1)[:1] == ["PARAM"]:
            control.params.append(line)
            continue
        match = _ORDER.match(text)
        if match is None:
            continue
        order, value = match.groups()
        if order == "TITLE" and not control.title:
            control.title = decoded(line.raw.partition("=")[2].encode("latin-1"))[:200]
        for name in _SELECTORS:
            if order == name or (len(order) >= 4 and name.startswith(order)):
                (subcases[-1] if subcases else common)[name] = (value, line.where)
    chosen = next((case for case in subcases if "METHOD" in case), subcases[0] if subcases else {})
    for name, (value, where) in {**common, **chosen}.items():
        control.selected[name], control.places[name] = value, where
    for case in subcases:
        for name, (value, where) in case.items():
            if value != control.selected.get(name):
                control.others.setdefault(name, []).append((value, where))
    return control


_NUMBERED = (
    re.compile(r"\$\s*HMNAME\s+PROP\s+(\d{1,12})\s*\"([^\"]*)\""),
    re.compile(r"\$\s*ANSA_NAME(?:_COMMENT)?;(\d{1,12});P[A-Z]+;([^;]*)"),
    re.compile(r"\$\*?\s*Property\s*:\s*(\d{1,12})\s+name\s*:\s*(.*)", re.IGNORECASE),
    re.compile(r"\$\*?\s*Femap.*\bProperty\s+(\d{1,12})\s*:\s*(.*)", re.IGNORECASE),
)
_NEXT = (
    re.compile(r"\$\s*Elements and Element Properties for region\s*:\s*(.*)", re.IGNORECASE),
    re.compile(r"\$\s*Pset:\s*\"([^\"]*)\""),
    re.compile(r"\$\*?\s.*\bProperty\s*:\s*(.*)", re.IGNORECASE),
)
PLATES = ("PSHELL", "PCOMP", "PCOMPG")
PROFILES = ("PBAR", "PBARL", "PBEAM", "PBEAML", "PROD", "PTUBE")
"""Cards of properties: of shells; of bars, beams and rods."""


def family(kind: str) -> str:
    """Properties of which no two have one number: of shells, of bars, of beams, of rods or of
    tubes.
    """
    return PLATES[0] if kind in PLATES else kind.removesuffix("L")


_LONGEST = 60


@dataclass
class Labels:
    """Names of properties; `hear` comments and `see` cards in their order."""

    numbered: dict[int, str] = field(default_factory=dict)
    following: dict[tuple[str, str], str] = field(default_factory=dict)
    _next: str = ""
    _given: dict[str, tuple[str, int]] = field(default_factory=dict)

    def hear(self, comment: str) -> None:
        """Take a name from a comment."""
        if '"' not in comment and ":" not in comment and ";" not in comment:
            return
        for pattern in _NUMBERED:
            if match := pattern.match(comment):
                self.numbered.setdefault(int(match.group(1)), _plain(match.group(2)))
                return
        for pattern in _NEXT:
            if match := pattern.match(comment):
                self._next = _plain(match.group(1))
                return

    def see(self, card: Card) -> None:
        """Give the next property the name that stood before it."""
        if self._next and card.name in (*PLATES, *PROFILES):
            self.following[card.name, card.text(0)] = self._next
            self._next = ""

    def of(self, card_name: str, number: int) -> str:
        """The set of a property: the name that the deck gives it, else `pshell_3`; no two alike."""
        own = f"{card_name.lower()}_{number}"
        name = self.following.get((card_name, str(number))) or self.numbered.get(number) or own
        owner = self._given.setdefault(name.lower(), (card_name, number))
        return name if owner == (card_name, number) else f"{name}_{number}"


def _plain(name: str) -> str:
    """A name of letters, digits and _ alone; empty where nothing is left."""
    return re.sub(r"\W+", "_", decoded(name.encode("latin-1"))).strip("_")[:_LONGEST]


_FRAMES = tuple(f"CORD{number}{kind}" for number in "12" for kind in "RCS")
_MATERIALS = ("MAT1", "MAT2", "MAT8", "MAT3", "MAT9", "MAT10")


class BdfDeck:
    """A deck whose readers take the cards that they read; what stays is not used.

    Attributes:
        case: which sets hold.
        labels: names of sets.
        notes: what is lost.
        mass_factor: PARAM WTMASS, by which masses and densities are multiplied.
        grids, materials: of the deck.
        plates: properties of shells by number.
        profiles: properties of bars, beams and rods by kind of card and number.
    """

    def __init__(self, content: bytes, included: Mapping[str, bytes]) -> None:
        split = split_deck(content, included)
        self.labels, self.notes = Labels(), ReadReport()
        if split.unended:
            self.notes.add(split.unended, "without_end")
        self.cards: dict[str, list[Card]] = defaultdict(list)
        for one in cards_of(split.bulk):
            if isinstance(one, Card):
                self.labels.see(one)
                self.cards[one.name].append(one)
            else:
                self.labels.hear(one.raw)
        self.case = read_case(split.control)
        params = [
            *(card for card in cards_of(self.case.params) if isinstance(card, Card)),
            *self.take("PARAM"),
        ]
        note_params(params, self.notes)
        self.mass_factor = next(
            (card.positive(1, "V1") for card in params if card.text(0) == "WTMASS"), 1.0
        )
        self.all = [card for group in self.cards.values() for card in group]
        defaults, grids = self.take("GRDSET"), self.take("GRID")
        refuse_solids(self.cards)
        if not grids:
            raise FormatError("", "the deck has no GRID; expected Nastran bulk data")
        self.grids: Grids = read_grids(
            grids, defaults[0] if defaults else None, self.take(*_FRAMES)
        )
        materials = numbered(self.take(*_MATERIALS), "material", "MID")
        self.materials = BdfMaterials(materials, self.mass_factor, self.notes)
        plates = self.take(*PLATES)
        self.profiles = {name: numbered(self.take(name), "property", "PID") for name in PROFILES}
        self.plates = numbered(plates, "property", "PID")

    def take(self, *names: str) -> list[Card]:
        """Cards of these names, which no other reader gets."""
        return [card for name in names for card in self.cards.pop(name, ())]

    def elements(self, *names: str) -> list[Card]:
        """Cards of elements, in the deck's order; numbers may not repeat among them."""
        cards = self.take(*names)
        numbered(cards, "element", "EID")
        return sorted(cards, key=lambda card: card.where.line) if len(names) > 1 else cards
