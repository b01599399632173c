"""A Nastran deck that goes back to its user with updated numbers."""

import difflib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from modalbase.formats.errors import FormatError
from modalbase.formats.models.bdf import read_bdf
from modalbase.formats.models.bdf.card import number
from modalbase.formats.models.bdf.write import fitted
from modalbase.formats.models.model import FiniteElementModel, ShellSection
from modalbase.formats.models.write import write_deck


def rewritten(content: bytes, updated: dict[str, dict[str, float]], *remarks: str) -> bytes:
    """The deck after an update, itself where nothing changes."""
    flat = {
        (name, constant): value for name, own in updated.items() for constant, value in own.items()
    }
    return write_deck(content, read_bdf(content), flat, remarks=remarks).get("", content)


DECK = """\
SOL 103
CEND
SPC = 1
BEGIN BULK
$ A comment: ENDDATA is not here
GRID           1              0.      0.      0.
GRID           2              1.      0.      0.
GRID           3              1.      1.      0.
GRID           4              0.      1.      0.
GRID           5              0.      0.      1.
GRID           6              0.      1.      1.
CQUAD4         1      10       1       2       3       4
CQUAD4         2      20       1       4       6       5
CQUAD4         3      30       2       3       6       5
CBAR           4      40       2       3      0.      0.      1.
CONROD,5,1,5,2,1.-4
$ Femap Property 10 : flange
PSHELL        10       1    .005       1               1              .5$keep me
$ Femap Property 20 : web
PSHELL  20      1       .003    1               1
PCOMP,30,,,,,,,SYM
,3,.001,45.,YES,4,.002,0.,YES
,3,,90.
PBAR    40      2       1.-3    2.-7    1.-7    3.-8    .1
MAT1           1  7.2+10              .3   2700.  2.3-5
MAT1,2,2.1+11,, .3,7850. $ steel
MAT8           3  1.4+11    9.+9      .3    5.+9    5.+9    3.+9   1600.
MAT8*                  4           5.+10            5.+9              .1+Z
*Z                  4.+9                                           2000.
PARAM   WTMASS  .5
SPC1           1  123456       1       2
ENDDATA
after the end
"""


def changed(before: str, after: bytes) -> tuple[list[str], list[str]]:
    """Lines that went, and that came."""
    lines = list(difflib.ndiff(before.splitlines(), after.decode("latin-1").splitlines()))
    return [line[2:] for line in lines if line[0] == "-"], [
        line[2:] for line in lines if line[0] == "+"
    ]


def test_nothing_updated_changes_no_byte() -> None:
    for text in (DECK, DECK.replace("\n", "\r\n"), DECK.replace("keep me", "é\tü")):
        content = text.encode("latin-1")
        assert write_deck(content, read_bdf(content), {}) == {}
        nominal = {"flange": {"E": 7.2e10, "nu": 0.3, "t": 0.005}, "pcomp_30": {"E1": 1.4e11}}
        assert rewritten(content, nominal) == content


def test_a_field_changes_in_its_own_format() -> None:
    updated = {
        "flange": {"t": 0.0051234567},
        "pcomp_30": {"E1": 1.3579e11, "G13_2": 4.5e9, "E1_2": 4.87654321e10},
        "pbar_40": {"I2": 2.345678e-7, "E": 2.0e11},
        "conrod_5": {"E": 2.0e11},
    }
    went, came = changed(DECK, rewritten(DECK.encode(), updated, "by part 7", "ν stays"))
    assert [line for line in came if not line.startswith("$")] == [
        "PSHELL        10       1.0051235       1               1              .5$keep me",
        "PBAR    40      2       1.-3    2.3457-71.-7    3.-8    .1",
        "MAT1,2,2.+11,, .3,7850. $ steel",
        "MAT8           31.358+11    9.+9      .3    5.+9    5.+9    3.+9   1600.",
        "MAT8*                  4    48765432100.            5.+9              .1+Z",
        "*Z                  4.+94500000000.                                2000.",
    ]
    assert len(went) == 6
    dos = DECK.replace("\n", "\r\n").encode()
    assert rewritten(dos, updated) == rewritten(DECK.encode(), updated).replace(b"\n", b"\r\n")
    assert {"$ by part 7", "$ ? stays"} <= set(came)
    assert "$ updated: thickness of flange was 0.005, is 0.0051234567" in came
    assert "$ updated: E of pbar_40, conrod_5 was 2.1e+11, is 2e+11" in came


def test_sets_that_part_get_materials_of_their_own() -> None:
    model = read_bdf(DECK.encode())
    after = rewritten(DECK.encode(), {"web": {"E": 6.9e10, "density": 1400.0}})
    went, came = changed(DECK, after)
    assert went == ["PSHELL  20      1       .003    1               1"]
    assert [line for line in came if not line.startswith("$")] == [
        "PSHELL  20      5       .003    5               5",
        "MAT1*   5               69000000000.                    .3",
        "*       2800.           2.3-5",
    ]
    assert after.endswith(b"ENDDATA\nafter the end\n")
    again = read_bdf(after)
    assert again.sections["web"].plies[0].material == "5"
    assert again.materials["5"].constants == pytest.approx(
        {"E": 6.9e10, "nu": 0.3, "G": 6.9e10 / 2.6, "density": 1400}
    )
    assert again.materials["1"].constants == model.materials["1"].constants


def test_an_isotropic_wall_that_is_found_orthotropic() -> None:
    model = read_bdf(DECK.encode())
    constants = {
        "E1": 7.3e10,
        "E2": 7.0e10,
        "nu12": 0.31,
        "G12": 2.7e10,
        "G13": 2.6e10,
        "G23": 2.5e10,
    }
    again = read_bdf(rewritten(DECK.encode(), {"flange": constants}))
    numbers = again.materials[again.sections["flange"].plies[0].material].constants
    assert numbers == pytest.approx({**constants, "density": 1350})
    assert (
        again.materials[again.sections["web"].plies[0].material].constants
        == model.materials["1"].constants
    )


def test_what_cannot_be_written_is_said() -> None:
    for updated, place, message in (
        ({"wing": {"E": 1.0}}, "wing.E", "there is no set 'wing'; there are flange, web"),
        ({"web": {"E7": 1.0}}, "web.E7", "1 of line 25 has no such constant"),
        (
            {"web": {"E_2": 1.0}},
            "web.E_2",
            "is none of this set's numbers in the deck; there are t, factor, E, nu, G",
        ),
        ({"web": {"E": float("nan")}}, "web.E", "expected a number"),
        (
            {"conrod_5": {"area": 1.0}},
            "conrod_5.area",
            "does not stand in the deck, which gives the section of line 16",
        ),
    ):
        with pytest.raises(FormatError) as caught:
            rewritten(DECK.encode(), updated)
        assert caught.value.place == place
        assert message in caught.value.message


def test_files_that_the_deck_includes() -> None:
    head, tail = DECK.split("MAT1           1")
    card, rest = tail.split("\n", 1)
    included = {"mat.inc": f"$ materials\nMAT1           1{card}\n".encode()}
    deck = f"{head}INCLUDE 'mat.inc'\n{rest}".encode()
    model = read_bdf(deck, included)
    both = {("flange", "E"): 7.1e10, ("web", "E"): 7.1e10}
    numbers = write_deck(deck, model, both, included=included)
    assert list(numbers) == ["mat.inc"]
    assert numbers["mat.inc"].endswith(b"MAT1           1  7.1+10              .3   2700.  2.3-5\n")
    one = write_deck(deck, model, {("web", "E"): 7.1e10}, included=included)
    assert list(one) == [""]
    assert read_bdf(one[""], included).materials["5"].constants["E"] == 7.1e10
    with pytest.raises(FormatError, match=r"mat\.inc line 2 is not here"):
        write_deck(deck, model, both)


def test_a_factor_of_all_moduli() -> None:
    before, again = (
        read_bdf(DECK.encode()),
        read_bdf(rewritten(DECK.encode(), {"pcomp_30": {"factor": 0.9}})),
    )
    for name in ("3", "4"):
        for constant, value in before.materials[name].constants.items():
            share = 0.9 if constant[0] in "EG" else 1.0
            assert again.materials[name].constants[constant] == pytest.approx(
                share * value, rel=1e-4
            )


def test_two_plates_of_a_stated_shear_modulus_and_a_mat2() -> None:
    deck = DECK.replace("MAT1,2,2.1+11,, .3,7850.", "MAT1,2,2.1+11,8.+10,,7850.")
    both = {"pbar_40": {"E": 2.0e11, "G": 7.7e10}, "conrod_5": {"E": 2.0e11, "G": 7.7e10}}
    again = read_bdf(rewritten(deck.encode(), both))
    assert (again.materials["2"].constants["E"], again.materials["2"].constants["G"]) == (
        2.0e11,
        7.7e10,
    )
    plane = DECK.replace(
        "MAT8           3  1.4+11    9.+9      .3    5.+9    5.+9    3.+9   1600.",
        "MAT2,3,1.4+11,3.+9,,9.+9,,5.+9,1600.",
    )
    model = read_bdf(plane.encode())
    again = read_bdf(rewritten(plane.encode(), {"pcomp_30": {"E1": 1.3e11, "G12": 4.8e9}}))
    expected = {
        **model.materials["3"].constants,
        "E1": 1.3e11,
        "G12": 4.8e9,
        "G13": 4.8e9,
        "G23": 4.8e9,
    }
    assert again.materials["3"].constants == pytest.approx(expected, rel=1e-3)


def test_plies_that_differ_in_density_alone_have_one_set_of_constants() -> None:
    twin = "MAT8           3  1.4+11    9.+9      .3    5.+9    5.+9    3.+9   1600.\n"
    deck = DECK.replace(twin, twin + twin.replace("       3", "       7").replace("1600.", "1500."))
    deck = deck.replace(
        "PCOMP,30,,,,,,,SYM\n,3,.001,45.,YES,4", "PCOMP,30,,,,,,,SYM\n,3,.001,45.,YES,7"
    )
    again = read_bdf(rewritten(deck.encode(), {"pcomp_30": {"E1": 1.3e11}}))
    assert [again.materials[name].constants["E1"] for name in ("3", "7")] == [1.3e11, 1.3e11]
    with pytest.raises(FormatError, match=r"pcomp_30\.E1_2"):
        rewritten(deck.encode(), {"pcomp_30": {"E1_2": 1.3e11}})


@given(st.floats(1e-30, 1e30), st.sampled_from([1, -1]), st.sampled_from([8, 16]))
def test_a_number_fits_its_field(value, sign, width) -> None:
    text = fitted(sign * value, width)
    assert len(text) <= width
    assert "." in text
    assert number(text) == pytest.approx(
        sign * value, rel=10.0 ** (5 + 1 - width + (1 if sign < 0 else 0))
    )


def stated(model: FiniteElementModel) -> dict[str, float]:
    """Every number of every set that can be updated."""
    numbers = {}
    for name in model.sets:
        section = model.sections[name]
        if isinstance(section, ShellSection):
            numbers[f"{name}.t"] = sum(ply.thickness for ply in section.plies)
            materials = list(dict.fromkeys(ply.material for ply in section.plies))
        else:
            numbers |= {
                f"{name}.{c}": v
                for c, v in zip(("I1", "I2"), section.inertia, strict=False)
                if c in section.places
            }
            materials = [section.material]
        for k, material in enumerate(materials, start=1):
            for constant, value in model.materials[material].constants.items():
                if constant != "density":
                    numbers[f"{name}.{constant}{f'_{k}' if k > 1 else ''}"] = value
    return numbers


NUMBERS_OF_DECK = sorted(stated(read_bdf(DECK.encode())))


@pytest.mark.parametrize("name", NUMBERS_OF_DECK)
def test_each_number_changes_alone(name) -> None:
    model = read_bdf(DECK.encode())
    before = stated(model)
    set_name, constant = name.split(".")
    after = stated(read_bdf(rewritten(DECK.encode(), {set_name: {constant: 1.037 * before[name]}})))
    tied = {f"{set_name}.G"} if constant in ("E", "nu") else set()
    assert after[name] == pytest.approx(1.037 * before[name], rel=2e-4)
    if constant == "G12_2":  # the card leaves G1Z and G2Z to the solver, and still does
        tied = {f"{set_name}.G13_2", f"{set_name}.G23_2"}
    if constant == "G":  # E, G and ν of an isotropic material cannot change one alone
        tied = {f"{set_name}.nu", f"{set_name}.E"}
    assert {n: v for n, v in after.items() if n not in (name, *tied)} == {
        n: v for n, v in before.items() if n not in (name, *tied)
    }


def test_a_mark_of_byte_order_stays_first_and_tabs_and_short_lines_are_written_in_place() -> None:
    deck = DECK.replace(
        "PSHELL  20      1       .003    1               1",
        "PSHELL\t20\t1\t.003\t1\t\t1\t\t$ a\ttab",
    )
    deck = deck.replace("MAT1,2,2.1+11,, .3,7850. $ steel", "MAT1,2,2.1+11")
    content = b"\xef\xbb\xbf" + deck.encode()
    after = rewritten(
        content,
        {"web": {"t": 0.004}, "conrod_5": {"E": 2.0e11}, "pbar_40": {"E": 2.0e11}},
        "by part 7",
    )
    assert after.startswith(b"\xef\xbb\xbf$ by part 7\nSOL 103\n")
    assert b"PSHELL  20      1       .004    1               1               $ a\ttab\n" in after
    assert b"\nMAT1,2,2.+11\n" in after
