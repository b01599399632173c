"""What is lost of a deck: cards that are not used, and parts of others."""

import re
from collections.abc import Iterable, Mapping, Sequence

from modalbase.formats.errors import FormatError
from modalbase.formats.models.bdf.card import Card
from modalbase.formats.models.model import Losses, where

_SOLIDS = frozenset(("CHEXA", "CTETRA", "CPENTA", "CPYRAM", "CPYRA", "CHEXA8", "CHEXA20", "CHEX8", "CHEX20", "CIHEX1"))

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
    (r"MPC|MPCADD", "constraint equations between grids"),
    (r"ASET1?|OMIT1?|QSET1?|BSET.*|CSET.*|DYNRED|SESET|SEBSET1?|SEQSET1?|SECSET1?", "a reduction to chosen dofs"),
    (r"CGAP|PGAP|BCTABLE|BCONTACT|BCBODY1?|BCTSET|BCTPARM|CONTACT", "gaps and contact"),
    (r"BGSET|BGPARM|BGADD", "glued contact, which joins parts"),
    (r"C(FAST|WELD|SEAM)|P(FAST|WELD|SEAM)|BOLT.*", "fasteners, which join parts"),
    (r"MATT\d+|MATS\d+|CREEP", "a material that varies with temperature or stress"),
    (r"CSHEAR|PSHEAR", "shear panels"),
    (r"CMASS\d|PMASS|CONM1", "masses at single dofs"),
    (r"[SE]POINT.*|CELAS[34]", "scalar points"),
    (r"RBE1|RROD|RTRPLT1?|RSPLINE|RSSCON|RJOINT|RBAR1", "a rigid element"),
    (r"CBEAM3|PBEAM3|CBEND|PBEND|CQUADX\d?|CTRIAX\d?|CTRAX.*|CCON.*|PCONEAX|CRAC.*|CQUAD|CPLST.*|CPLSTN.*|CRO[DT].*",
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


def note_unused(cards: Mapping[str, Iterable[Card]], notes: Losses) -> None:
    """Note cards that no reader took."""
    for name, group in cards.items():
        loss, changes = _loss(name)
        for card in group:
            if loss:
                notes.add(card, name, loss, changes)


def refuse_solids(cards: Mapping[str, Sequence[Card]]) -> None:
    """Refuse a deck with solid elements.

    Raises:
        FormatError: it has some; the message says which way is open.
    """
    for name in _SOLIDS & set(cards):
        first = cards[name][0]
        raise FormatError(
            where(first.line, first.file),
            f"{name}: solid elements are not read. Let Nastran export the model's matrices (DMIG punch: EXTSEOUT(DMIGPCH), "
            "or PARAM,EXTOUT,DMIGPCH) and send these",
        )


def _loss(name: str) -> tuple[str, bool]:
    for pattern, loss, changes in _TABLE:
        if pattern.fullmatch(name):
            return f"not used: {loss}" if loss else "", changes
    return "not used: a card that is not known here", True


def note_params(cards: Iterable[Card], notes: Losses) -> None:
    """Note PARAM cards; WTMASS is used elsewhere."""
    for card in cards:
        name = card.text(0)
        if name == "K6ROT" and card.text(1) and card.real(1, "V1") > _STIFFENED_DRILLING:
            notes.add(card, "PARAM K6ROT", "the stiffness against rotation about the normal is ours, 0.01 G t", True)
        elif name not in ("WTMASS", ""):
            notes.add(card, "PARAM", "settings of the solver are not used")
