# ruff: noqa: E501 - a row of the table of bad decks is one line
"""Bad decks of Nastran: each a sentence with line, card, field, what was expected."""

import pickle
import re

import pytest

from modalbase.formats.errors import FormatError
from modalbase.formats.models.bdf import read_bdf
from modalbase.formats.models.model import FiniteElementModel
from tests.support.damage import damaged
from tests.support.lengths import fuzz, long
from tests.unit.formats.models.decks import ENDS, GRIDS, SQUARE

FIBRE = GRIDS + "CQUAD4,1,1,1,2,3,4\nPCOMP,1\n,2,.001,0.\n"


def of_plate(old: str, new: str) -> str:
    assert old in SQUARE
    return SQUARE.replace(old, new)


BAD = {
    "empty": ("", "", "no GRID"),
    "not text": ("GRID\0", "", "NUL"),
    "cut in control": ("SOL 103\nCEND\nSPC = 1\n", "line 3", "before BEGIN BULK; it seems to be cut"),
    "cut in bulk": ("SOL 103\nCEND\nBEGIN BULK\n" + SQUARE.rstrip("\n"), "line 10", "without ENDDATA; it seems to be cut"),
    "cut in a card": (of_plate("MAT1,1,7.+10,,.3,2700.\n", "MAT1,1"), "line 7", "MAT1 1: E (field 3) is empty, expected two of E, G and NU"),
    "superelement": ("CEND\nBEGIN BULK\n" + SQUARE + "BEGIN SUPER=1\n", "line 10", "superelements are not read"),
    "no elements": (GRIDS, "", "no shell or beam element"),
    "grid twice": (SQUARE + "GRID,2,,5.,5.,5.\n", "line 8", "GRID 2: the grid is there twice, first in line 2"),
    "grid by a word": (SQUARE + "GRID,A,,5.\n", "line 8", "GRID A: ID (field 2) is 'A', expected a whole number"),
    "coordinate": (of_plate("2,,1.", "2,,1.O"), "line 2", "GRID 2: X1 (field 4) is '1.O', expected a real number"),
    "too large": (of_plate("2,,1.", "2,,1.+400"), "line 2", "X1 (field 4) is '1.+400', expected a real number"),
    "missing grid": (of_plate("1,2,3,4", "1,2,3,9"), "line 5", "CQUAD4 1: G4 (field 7) is '9', expected a grid of the deck; there is no GRID 9"),
    "grid as a real": (of_plate("1,2,3,4", "1,2,3.,4"), "line 5", "G3 (field 6) is '3.', expected a whole number"),
    "grid twice in an element": (of_plate("1,2,3,4", "1,2,2,4"), "line 5", "CQUAD4 1: "),
    "crossed": (of_plate("1,2,3,4", "1,3,2,4"), "line 5", "element 1 of the set pshell_1 has no size"),
    "re-entrant": (of_plate("3,,1.,1.", "3,,.1,.1"), "line 5", "element 1 of the set pshell_1 folds over"),
    "no area": (of_plate("CQUAD4,1,1,1,2,3,4", "GRID,5,,2.,0.,0.\nCTRIA3,1,1,1,2,5"), "line 6", "element 1 of the set pshell_1 has no size"),
    "missing property": (of_plate("CQUAD4,1,1", "CQUAD4,1,7"), "line 5", "PID (field 3) is '7', expected a property of shells; there is no PSHELL or PCOMP 7"),
    "missing material": (of_plate("MAT1,1", "MAT1,2"), "line 6", "PSHELL 1: MID1 (field 3) is '1', expected a material of the deck"),
    "solid's material": (of_plate("MAT1,1,7.+10,,.3,2700.", "MAT9,1,1.,2."), "line 6", "expected MAT1, MAT2 or MAT8; 1 is a MAT9"),
    "element twice": (SQUARE + "CQUAD4,1,1,1,2,3,4\n", "line 8", "CQUAD4 1: the element is there twice, first in line 5"),
    "property twice": (SQUARE + "PSHELL,1,1,.02\n", "line 8", "PSHELL 1: the property is there twice, first in line 6"),
    "material twice": (SQUARE + "MAT1,1,1.,,.1\n", "line 8", "MAT1 1: the material is there twice, first in line 7"),
    "zero thickness": (of_plate(",.01,", ",0.,"), "line 6", "PSHELL 1: T (field 4) is '0.', expected a number above zero"),
    "no thickness": (of_plate(",.01,", ",,"), "line 5", "CQUAD4 1: neither it nor PSHELL 1 (line 6) states a thickness"),
    "no thickness all round": (of_plate("1,2,3,4\n", "1,2,3,4\n,,,0.,0.,0.,0.\n"), "line 6", "CQUAD4 1: T1 (field 4) is '0.', expected a thickness that is not negative, and not zero all round"),
    "zero modulus": (of_plate("7.+10", "0."), "line 7", "MAT1 1: E (field 3) is '0.', expected a number above zero"),
    "Poisson's ratio": (of_plate(",.3,", ",1.3,"), "line 7", "MAT1 1: NU (field 5) is '1.3', expected a Poisson's ratio"),
    "density": (of_plate("2700.", "-1."), "line 7", "MAT1 1: RHO (field 6) is '-1.', expected a density"),
    "lamina": (FIBRE + "MAT8,2,1.,9.,.4,1.\n", "line 8", "MAT8 2: NU12 (field 5) is '.4', expected below √(E1/E2) = 0.333"),
    "no plies": (FIBRE.replace("\n,2,.001,0.", "") + "MAT8,2,9.,9.,.4,1.\n", "line 6", "PCOMP 1: it has no plies"),
    "ply without thickness": (FIBRE.replace(",.001,", ",,") + "MAT8,2,9.,9.,.4,1.\n", "line 7", "PCOMP 1: T (field 3) is empty"),
    "plies without direction": (FIBRE.replace("3,4\n", "3,4,5\n") + "MAT8,2,9.,9.,.4,1.\nCORD2R,5,,0.,0.,0.,1.,0.,0.\n,0.,0.,1.\n", "line 5", "stands on the element"),
    "missing system": (of_plate("GRID,2,,", "GRID,2,8,"), "line 2", "GRID 2: CP (field 3) is '8', expected a coordinate system of the deck; there is no CORD 8"),
    "missing MCID": (of_plate("1,2,3,4", "1,2,3,4,8"), "line 5", "CQUAD4 1: MCID (field 8) is '8'"),
    "missing RID": (SQUARE + "CORD2R,5,6,0.,0.,0.,1.,0.,0.\n,0.,0.,1.\n", "line 8", "CORD2R 5: RID (field 3) is '6'"),
    "circle of systems": (SQUARE + "CORD2R,5,6,0.,0.,0.,1.,0.,0.\n,0.,0.,1.\nCORD2R,6,5,0.,0.,0.,1.,0.,0.\n,0.,0.,1.\n", "line 8|line 10", "refer to one another in a circle"),
    "circle through a grid": (SQUARE + "GRID,9,5,0.,0.,0.\nCORD1R,5,1,2,9\n", "line 9", "in a circle: 5 → 5"),
    "flat system": (SQUARE + "CORD2R,5,,0.,0.,0.,1.,0.,0.\n,2.,0.,0.\n", "line 8", "CORD2R 5: the points A, B and C lie on a line"),
    "system twice": (SQUARE + "CORD1R,5,1,2,3\nCORD1R,5,1,2,4\n", "line 9", "the coordinate system 5 is there twice, first in line 8"),
    "stray continuation": (SQUARE + "GRID,9,,1.,1.,1.,,,,+A\n+B,1.\n", "line 9", "the continuation '+B' continues no card"),
    "continuation first": ("+,1.,2.\n" + SQUARE, "line 1", "continues no card"),
    "long line": (SQUARE + "GRID,9,,1.,1.,1.,,,,,1,2,3\n", "line 8", "GRID has 12 fields; a line holds 8"),
    "replication": (SQUARE + "=,*1,=\n", "line 8", "replication by = is not read"),
    "missing INCLUDE": (SQUARE + "INCLUDE 'more/x.bdf'\n", "line 8", "INCLUDE 'more/x.bdf' is not here; send that file with the deck"),
    "solid": (SQUARE + "CHEXA,9,1,1,2,3,4,5,6\n,7,8\n", "line 8", "CHEXA: solid elements are not read. Let Nastran export the model's matrices (DMIG punch"),
    "free part": (SQUARE + "GRID,11,,9.,0.,0.\nGRID,12,,9.,1.,0.\nGRID,13,,8.,1.,0.\nCTRIA3,7,1,11,12,13\n", "", "nothing holds 2 of them: element 1 of the set pshell_1 (line 5); element 7"),
    "middles in part": (GRIDS + "GRID,5,,.5,0.,0.\nCQUAD8,1,1,1,2,3,4,5\nPSHELL,1,1,.01\nMAT1,1,1.,,.1\n", "line 6", "the middles of all sides, or of none"),
    "bar along itself": (ENDS + "CBAR,1,1,1,2,1.,0.,0.\nPBAR,1,1,1.,1.,1.,1.\n", "line 4", "CBAR 1: the orientation vector is along the beam"),
    "bar without direction": (ENDS + "CBAR,1,1,1,2\nPBAR,1,1,1.,1.,1.,1.\n", "line 4", "CBAR 1: X1 (field 6) is empty, expected a direction X1, X2, X3 or a grid G0"),
    "bar without length": (ENDS + "CBAR,1,1,1,1,0.,0.,1.\nPBAR,1,1,1.,1.,1.,1.\n", "line 4", "CBAR 1: its length is zero"),
    "bar by a beam's property": (ENDS + "CBAR,1,1,1,2,0.,0.,1.\nPBEAM,1,1,1.,1.,1.,,1.\n", "line 4", "there is no PBAR or PBARL 1"),
    "no area of a bar": (ENDS + "CBAR,1,1,1,2,0.,0.,1.\nPBAR,1,1,,1.,1.,1.\n", "line 5", "PBAR 1: the area is 0"),
    "moments": (ENDS + "CBAR,1,1,1,2,0.,0.,1.\nPBAR,1,1,1.,1.,1.,1.\n,,,,,,,,\n,,,2.\n", "line 5", "I12² ≤ I1 I2"),
    "shape": (ENDS + "CBAR,1,1,1,2,0.,0.,1.\nPBARL,1,1,,BLOB\n,1.\n", "line 5", "TYPE (field 5) is 'BLOB', expected one of ROD"),
    "dimension": (ENDS + "CBAR,1,1,1,2,0.,0.,1.\nPBARL,1,1,,BAR\n,1.\n", "line 6", "PBARL 1: DIM2 (field 3) is empty"),
    "dimensions": (ENDS + "CBAR,1,1,1,2,0.,0.,1.\nPBARL,1,1,,TUBE\n,1.,2.\n", "line 6", "PBARL 1: the dimensions are of no TUBE"),
    "walls too thick": (ENDS + "CBAR,1,1,1,2,0.,0.,1.\nPBARL,1,1,,BOX\n,1.,1.,.6,.1\n", "line 6", "PBARL 1: the dimensions are of no BOX"),
    "mass": (SQUARE + "CONM2,7,3,0,-1.\n", "line 8", "CONM2 7: M (field 5) is '-1.', expected a mass"),
    "inertia": (SQUARE + "CONM2,7,3,0,1.\n,-1.\n", "line 9", "CONM2 7: the inertia I11 … I33 is of no body"),
    "mass nowhere": (SQUARE + "CONM2,7,33,0,1.\n", "line 8", "CONM2 7: G (field 3) is '33', expected a grid of the deck"),
    "spring's component": (SQUARE + "CELAS2,7,5.,3,12\n", "line 8", "C1 (field 5) is '12', expected one component"),
    "negative spring": (SQUARE + "CELAS2,7,-5.,3,1\n", "line 8", "CELAS2 7: the stiffness is -5"),
    "missing PELAS": (SQUARE + "CELAS1,7,5,3,1\n", "line 8", "there is no PELAS 5"),
    "two PELAS": (SQUARE + "PELAS,5,1.,,,5,2.\n", "line 8", "the property is there twice, with two stiffnesses"),
    "bush without system": (SQUARE + "CBUSH,7,5,3\nPBUSH,5,K,1.\n", "line 8", "CBUSH 7: CID (field 9) is empty"),
    "bush without direction": (SQUARE + "CBUSH,7,5,1,3\nPBUSH,5,K,,1.\n", "line 8", "since K2, K3, K5 or K6 is given"),
    "led twice": (SQUARE + "RBE2,7,1,123,2\nRBE2,8,3,3,2\n", "line 9", "leads node 2, which line 8 leads already"),
    "held where it is led": (SQUARE + "RBE2,7,1,123456,2\nSPC1,1,3,2\n", "line 9", "holds node 2 in what line 8 has node 1 lead"),
    "leads itself": (SQUARE + "RBE2,7,1,123,1\n", "line 8", "nodes lead one another in a circle: 1 → 1"),
    "leads none": (SQUARE + "RBE2,7,1,123\n", "line 8", "GM1 (field 5) is empty, expected a grid that is led"),
    "components": (SQUARE + "SPC1,1,127,1\n", "line 8", "SPC1 1: C (field 3) is '127', expected components of 1 … 6"),
    "range backwards": (SQUARE + "SPC1,1,123,4,THRU,1\n", "line 8", "expected a number above 4, where the range begins"),
    "no leaders": (SQUARE + "RBE3,7,,1,123\n", "line 8", "it has no leaders with a weight above zero"),
    "WTMASS": (SQUARE + "PARAM,WTMASS,0.\n", "line 8", "PARAM WTMASS: V1 (field 3) is '0.', expected a number above zero"),
}  # fmt: skip


@pytest.mark.parametrize("name", sorted(BAD))
def test_a_bad_deck_is_named(name) -> None:
    text, place, message = BAD[name]
    with pytest.raises(FormatError) as caught:
        read_bdf(text.encode())
    error = caught.value
    assert message in error.message
    assert error.place in place.split("|")
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


WHOLE = """\
SOL 103
CEND
SPC = 1
NSM = 4
BEGIN BULK
PARAM   WTMASS  .00259
GRDSET                                                          6
CORD2C         1       0      0.      0.      0.      0.      0.      1.+A
+A            1.      0.      1.
GRID           1       0      0.      0.      0.
GRID           2       1      1.      0.      0.       1
GRID           3       1 1.41421     45.      0.       1
GRID*                  4                              0.              1.
*                     0.
GRID           5              1.      0.      1.
GRID           6              0.      0.      1.
CQUAD4         1       1       1       2       3       4     30.     .01
CTRIA3         2       2       1       2       5       1
CBAR           3       3       2       5      0.      1.      0.
+                                     .0      .1      .0      .0      .1
CBEAM,4,4,5,6,0.,1.,0.
PSHELL         1       1     .01       1               1              2.
PCOMP          2                                                     SYM
+              2    .001     45.     YES                     90.
PBAR           3       1   1.-3   1.-7   1.-7   1.-7
PBEAML         4       1               I
+            .05     .03     .03    .002    .003    .003
MAT1           1  7.2+10              .3   2700.
MAT8           2  1.4+11    9.+9      .3    5.+9    5.+9    3.+9   1600.
CONM2          7       5       0      2.      .1
+             1.              1.                      1.
CELAS2         8   1000.       6       3
CBUSH,9,5,3,6,1.,1.,0.
PBUSH,5,K,1.+5,1.+5,,1.+2
RBE2          10       1  123456       6
RBE3,11,,4,123,1.,123,1,2,3
NSM1,4,PSHELL,1.,1
SPC1           1  123456       1    THRU       2
PLOAD4,1,1,2.
ENDDATA
"""


def test_the_deck_that_the_fuzz_begins_with_is_read() -> None:
    model = read_bdf(WHOLE.encode())
    assert sum(len(block.numbers) for block in model.elements) == 4
    assert all(not one.changes for one in model.ignored)


def check(content: bytes) -> None:
    """A model whose parts fit together, or an error with a place: nothing else may come of a
    deck.
    """
    faults: list[tuple[str, str]] = []
    model: FiniteElementModel | None = None
    try:
        model = read_bdf(content)
    except FormatError as error:
        faults = error.faults
    assert all(re.fullmatch(r"(line \d+)?", place) and message for place, message in faults)
    for block in model.elements if model else ():
        assert block.nodes.max() < len(model.nodes)
        assert block.set in model.sections


FIELDS = [
    "", "0", "1", "-1", "7", "99999999", "1.", "-1.", "0.", "1.+300", "1.-300", "NAN", "1E999", "THRU", "ALL", "123456",
    "GGG", "SYM", "$", "9" * 40,
]  # fmt: skip


@pytest.mark.parametrize("examples", [100, long(600)])
def test_a_damaged_deck(examples: int) -> None:
    decks = damaged([WHOLE, WHOLE[WHOLE.index("PARAM") :]], FIELDS)
    fuzz(examples, decks, lambda text: check(text.encode()))


def test_a_range_without_end_takes_no_memory() -> None:
    wide = (
        SQUARE
        + "SPC1,1,12,1,THRU,999999999999\nRBE2,9,1,3,2,THRU,99999999\nNSM1,1,PSHELL,1.,1,THRU,99999999\n"
    )
    model = read_bdf(wide.encode())
    assert model.supports[0].nodes.tolist() == [0, 1, 2, 3]
