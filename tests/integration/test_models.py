"""Users' models over HTTP: a deck goes in, the structure is it, an update finds the constants of
its sets.
"""

import io
import json
import zipfile
from concurrent.futures import ThreadPoolExecutor
from shutil import which
from typing import Any

import httpx
import numpy as np
import pytest

from modalbase.formats.models.inp import read_inp
from modalbase.formats.uff import Axis, Frf, GridPoint
from modalbase.formats.uff.write import encode
from service.app.supervisor import LocalService
from tests.integration.test_bodies import FEW_MODES, updated
from tests.support.calculix import ccx, frequencies
from tests.support.lengths import long
from tests.support.places import ROOT, shared_file
from tests.support.profiles import ANGLE, TRUTH, deck, measured, points
from tests.support.rest import finished, ok, posted, result_of, session_client

HEAD, CARDS = (
    "SOL 103\nCEND\nBEGIN BULK\n",
    "CQUAD4,1,1,1,2,3,4\nPSHELL,1,1,.01,1,,1\nMAT1,1,7.+10,,.3,2700.\nENDDATA\n",
)
HELD_HZ = (52.4, 157.6, 175.7, 342.6, 349.2, 377.1)  # of the clamped angle of `profiles.TRUTH`
GRIDS = "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,1.,.2,0.\nGRID,4,,0.,.2,0.\n"


@pytest.fixture
def bare(api: httpx.Client, project: str) -> str:
    """A structure that nothing is said of."""
    return str(ok(api.post(f"projects/{project}/structures", json={"name": "bracket"}), 201)["id"])


def sent(api: httpx.Client, structure: str, content: bytes, **query: Any) -> dict[str, Any]:
    """A model after its reading."""
    queued = api.post(
        f"structures/{structure}/model", params={"filename": "angle.inp", **query}, content=content
    )
    ok(queued, 202)
    return finished(api, queued.headers["Location"])


def test_a_deck_is_read_and_shown(api: httpx.Client, bare: str) -> None:
    content = deck()
    model = sent(api, bare, content, units="m-N-kg")
    assert (model["status"], model["version"]) == ("succeeded", 2)
    contents = model["found"]
    assert contents["counts"] == {
        "nodes": 475,
        "elements": 140,
        "masses": 0,
        "springs": 0,
        "links": 0,
        "supports": 1,
    }
    sets = {each["name"]: each for each in contents["sets"]}
    assert sets["flange"]["area_m2"] == pytest.approx(0.4 * 0.058)
    assert sets["flange"]["mass_kg"] == pytest.approx(0.4 * 0.058 * 0.004 * 1850)
    assert sets["web"]["thickness_m"] == 0.004
    assert contents["mass_kg"] == pytest.approx(
        0.4 * (0.06 + 0.076) * 0.004 * 1850
    )  # with the joint: the whole of both walls
    (material,) = contents["materials"]
    assert (material["name"], material["constants"]["E1"]) == ("GFRP", 23e9)
    (junction,) = contents["junctions"]
    assert [(wall["set"], wall["passes"]) for wall in junction["walls"]] == [
        ("flange", False),
        ("web", False),
    ]
    assert junction["length_m"] == pytest.approx(0.4)
    (support,) = contents["supports"]
    assert support["dofs"] == [1, 2, 3, 4, 5, 6]
    structure = ok(api.get(f"structures/{bare}"), 200)
    assert (structure["version"], structure["model"], structure["geometry"]) == (
        2,
        model["id"],
        None,
    )
    page = api.get(str(api.base_url.copy_with(path=f"/ui/structures/{bare}"))).text
    assert 'value="as_modelled"' in page
    assert 'value="cantilever"' not in page
    assert "Density" not in page
    assert ok(api.get(f"structures/{bare}/model"), 200) == model
    mesh = ok(api.get(f"structures/{bare}/model/mesh"), 200)
    assert len(mesh["nodes"]["x_m"]) == 475
    assert mesh["nodes"]["numbers"][:3] == [1, 2, 3]
    assert [(block["set"], block["kind"], len(block["nodes"][0])) for block in mesh["blocks"]] == [
        ("flange", "quad8", 8),
        ("web", "quad8", 8),
    ]
    original = api.get(f"structures/{bare}/model/original")
    assert original.content == content
    again = api.get(
        f"structures/{bare}/model/original", headers={"If-None-Match": original.headers["ETag"]}
    )
    assert again.status_code == 304


def zipped(**files: bytes) -> bytes:
    """An archive of files by name."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return buffer.getvalue()


def test_an_archive_without_one_deck_is_refused(api: httpx.Client, bare: str) -> None:
    whole = (HEAD + GRIDS + CARDS).encode()
    two = sent(
        api, bare, zipped(**{"a.bdf": whole, "b.bdf": whole}), units="m-N-kg", filename="two.zip"
    )
    assert "a.bdf, b.bdf, expected one deck" in two["message"]
    buffer, again = (
        io.BytesIO(zipped(**{"a.bdf": whole})),
        pytest.warns(UserWarning, match="Duplicate"),
    )
    with zipfile.ZipFile(buffer, "a") as archive, again:
        archive.writestr("a.bdf", whole)
    twice = sent(api, bare, buffer.getvalue(), units="m-N-kg", filename="twice.zip")
    assert "a.bdf: is in the file twice" in twice["message"]
    assert "no zip" in sent(api, bare, whole, units="m-N-kg", filename="no.zip")["message"]


def test_a_deck_of_nastran_and_what_it_includes_come_in_one_zip(
    api: httpx.Client, bare: str
) -> None:
    whole = (HEAD + GRIDS + CARDS).encode()
    main = (HEAD + "include 'mesh/grids.bdf'\n" + CARDS).encode()
    plain = sent(api, bare, whole, units="m-N-kg", filename="plate.bdf")["found"]
    model = sent(
        api,
        bare,
        zipped(**{"a/plate.bdf": main, "a/mesh/grids.bdf": GRIDS.encode()}),
        units="m-N-kg",
        filename="p.zip",
    )
    assert model["status"] == "succeeded", model["message"]
    assert {**model["found"], "materials": None, "sets": None} == {
        **plain,
        "materials": None,
        "sets": None,
    }
    assert model["found"]["mass_kg"] == pytest.approx(0.2 * 0.01 * 2700)
    lacking = sent(api, bare, zipped(**{"a/plate.bdf": main}), units="m-N-kg", filename="p.zip")
    assert "mesh/grids.bdf" in lacking["message"]


def test_units_are_asked_for_with_those_that_fit(api: httpx.Client, bare: str) -> None:
    model = sent(api, bare, deck(1e-3))
    assert model["status"] == "failed"
    assert "units=mm-N-t?" in model["message"]
    wrong = sent(api, bare, deck(1e-3), units="m-N-kg")
    assert "mm-N-t would fit" in wrong["message"]
    params = {"filename": "angle.inp", "units": "mm-stone"}
    unknown = ok(api.post(f"structures/{bare}/model", params=params, content=deck()), 422)
    assert "names no units" in unknown["errors"][0]["detail"]
    assert ok(api.get(f"structures/{bare}"), 200)["version"] == 1
    assert "is no model" in ok(api.get(f"structures/{bare}/model"), 409)["detail"]
    right = sent(api, bare, deck(1e-3), units="mm-N-t")
    assert right["found"]["size_m"] == pytest.approx([0.4, 0.058, 0.078])


def test_a_card_that_changes_modes_must_be_accepted_by_name(api: httpx.Client, bare: str) -> None:
    content = deck().replace(b"*STEP", b"*CONTACT PAIR, INTERACTION=I\nA, B\n*STEP", 1)
    refused = sent(api, bare, content, units="m-N-kg")
    assert refused["status"] == "failed"
    assert "CONTACT PAIR" in refused["message"]
    assert "accept=CONTACT PAIR" in refused["message"]
    taken = sent(api, bare, content, units="m-N-kg", accept="contact pair")
    (lost,) = [each for each in taken["found"]["ignored"] if each["changes"]]
    assert "CONTACT PAIR" in lost["card"]
    assert taken["accepted"] == ["contact pair"]


def test_a_mesh_comes_with_sections_of_its_sets(api: httpx.Client, bare: str) -> None:
    content, wall = (ROOT / "tests/corpus/meshes/gmsh-4.1.msh").read_bytes(), {"thickness_m": 0.002}
    metal = {**wall, "isotropic": {"E_Pa": 7e10, "nu": 0.3, "density_kg_m3": 2700}}
    params = {"filename": "angle.msh", "units": "mm-N-t"}
    bare_mesh = sent(api, bare, content, **params, accept="clamp")
    assert "lack flange (2 elements), the_web (4 elements)" in bare_mesh["message"]
    one = sent(api, bare, content, **params, sections=json.dumps({"flange": metal, "web": metal}))
    assert "sections/web: there is no such set; there are clamp, flange, the_web" in one["message"]
    both = {"flange": metal, "the_web": metal}
    assert (
        "accept=CLAMP" in sent(api, bare, content, **params, sections=json.dumps(both))["message"]
    )
    address = f"structures/{bare}/model"
    fields = {"sections": json.dumps({**both, "clamp": {"held_dofs": [1, 2, 3, 4, 5, 6]}})}
    form = api.post(
        address, params={"units": "mm-N-t"}, data=fields, files={"file": ("angle.msh", content)}
    )
    model = finished(api, form.headers["Location"])
    assert model["status"] == "succeeded", model["message"]
    assert model["sections"]["flange"]["isotropic"]["E_Pa"] == 7e10
    assert [(each["name"], each["elements"]) for each in model["found"]["sets"]] == [
        ("flange", 2),
        ("the_web", 4),
    ]
    assert model["found"]["supports"] == [
        {"nodes": 5, "dofs": [1, 2, 3, 4, 5, 6], "line": 0, "file": None}
    ]
    assert ok(api.get(f"{address}/mesh"))["blocks"][0]["set"] == "flange"
    page = api.get(str(api.base_url.copy_with(path=f"/ui/structures/{bare}"))).text
    assert "angle.msh" in page
    for wrong, what in [
        ({"flange": wall}, "state thickness_m and a material"),
        ({"flange": {**metal, "thickness_m": 2}}, "did you mean"),
        ({"flange": {**wall, "material": ANGLE["shape"]["material"]}}, "density_kg_m3 is missing"),
    ]:
        problem = ok(
            api.post(address, params={**params, "sections": json.dumps(wrong)}, content=content),
            422,
        )
        assert problem["errors"][0]["pointer"].startswith("/flange"), problem
        assert what in problem["errors"][0]["detail"]
    deck_with = sent(api, bare, deck(), units="m-N-kg", sections=json.dumps(both))
    assert "a deck has its own" in deck_with["message"]


def test_what_is_wrong_with_a_deck_is_said_by_line(api: httpx.Client, bare: str) -> None:
    cut = sent(api, bare, deck()[: deck().index(b"*SHELL SECTION") - 5], units="m-N-kg")
    assert cut["status"] == "failed"
    assert "line" in cut["message"]
    params = {"filename": "angle.xyz", "units": "m-N-kg"}
    other = ok(api.post(f"structures/{bare}/model", params=params, content=deck()), 422)
    assert "ends in none of .inp" in other["errors"][0]["detail"]
    assert ok(api.get(f"structures/{bare}"), 200)["version"] == 1


@pytest.mark.parametrize("boundary", ["as_modelled", long("free")])
def test_an_update_of_a_deck_finds_the_constants_of_its_sets(
    api: httpx.Client, bare: str, boundary: str
) -> None:
    """What a user of a solver wants: a deck with what it includes and FRFs go in, the same files
    come back with their constants.
    """
    model = sent(api, bare, zipped(**parted()), units="m-N-kg", filename="angle.zip")
    assert model["status"] == "succeeded", model["message"]
    assert model["found"]["materials"][0]["constants"]["E1"] == 23e9
    content = measured(boundary="free" if boundary == "free" else "cantilever")
    address, result = updated(api, bare, content, boundary, FEW_MODES)
    constants = {row["name"]: row for row in result["parameters"]}
    for name, value in TRUTH.items():
        low, high = constants[name]["interval_95"]
        assert low < value < high, name
    handed_back(api, address, constants)
    for name in ("frf", "shapes", "sac"):
        assert ok(api.get(f"{api.base_url.join(address)}/figures/{name}"), 200)["data"]


def parted() -> dict[str, bytes]:
    """The deck in two files, of which one includes the other."""
    whole = deck()
    start, end = whole.index(b"*MATERIAL"), whole.index(b"*SHELL SECTION")
    main = whole[:start] + b"*INCLUDE, INPUT=mat/gfrp.inp\n" + whole[end:]
    return {"job/angle.inp": main, "job/mat/gfrp.inp": whole[start:end]}


def handed_back(api: httpx.Client, address: str, constants: dict[str, Any]) -> None:
    """The updated deck is the one that was sent, but for the numbers that were updated, and reads
    back.
    """
    answer = api.get(f"{api.base_url.join(address)}/deck")
    assert answer.headers["content-disposition"] == 'attachment; filename="updated-angle.zip"'
    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        assert archive.namelist() == list(parted())
        main, included = map(archive.read, archive.namelist())
    assert b"updated: E1 of" in included
    content = main.replace(b"*INCLUDE, INPUT=mat/gfrp.inp\n", included)
    assert "/deck is it" in ok(api.get(f"{api.base_url.join(address)}/cards"), 409)["detail"]
    lines, before = content.splitlines(), deck().splitlines()
    nodes = slice(before.index(b"*NODE, NSET=ALL"), before.index(b"*ORIENTATION, NAME=O"))
    assert b"\n".join(before[nodes]) in content
    head = [line for line in lines if line.startswith(b"**")]
    assert any(b"with joints" in line for line in head)
    assert sum(b"mode " in line and b"% from" in line for line in head) >= 4
    model = read_inp(content)
    for name in ("flange", "web"):
        (material,) = (model.materials[each] for each in model.sections[name].materials)
        for constant in ("E1", "E2", "G12", "G13", "G23"):
            assert material.constants[constant] == pytest.approx(
                constants[f"{name}.{constant}"]["estimate"], rel=1e-6
            )
    # the one that both had was parted
    assert model.sections["flange"].materials != model.sections["web"].materials


def test_without_joints_a_result_and_its_deck_say_so(
    api: httpx.Client, service: LocalService, bare: str
) -> None:
    sent(api, bare, deck(), units="m-N-kg")
    body = {"name": "typed", "boundary": "as_modelled"}
    campaign = posted(api, f"structures/{bare}/campaigns", body)["id"]
    typed = {"name": "typed", "modes": [{"frequency_hz": hz} for hz in HELD_HZ[:2]]}
    modes = posted(api, f"campaigns/{campaign}/mode-sets", typed)["id"]
    recipe = {"junctions": "off", "mode_set": modes, "parameters": [{"name": "flange.E1"}]}
    begun = api.post(f"campaigns/{campaign}/update-jobs", json=recipe).headers["Location"]
    assert finished(api, begun)["status"] == "succeeded"
    say_that_joints_lack(api, begun, result_of(api, begun))
    with session_client(api, base=service.url) as browser:
        page = browser.get(f"/ui/{begun.removeprefix('/api/v1/')}")
    assert "Your deck, updated" in page.text
    assert "/cards?format" not in page.text


def say_that_joints_lack(api: httpx.Client, address: str, result: dict[str, Any]) -> bytes:
    """The updated deck."""
    (finding,) = [each for each in result["findings"] if each["kind"] == "without_joints"]
    assert "wrong by 1.6 %" in finding["text"]
    assert result["provenance"]["recipe"]["junctions"] == "off"
    updated_deck = api.get(f"{api.base_url.join(address)}/deck").content
    head = [line for line in updated_deck.decode().splitlines() if line.startswith("** ")]
    assert any("without a model of the joints" in line for line in head)
    return updated_deck


@pytest.mark.long
@pytest.mark.skipif(which("ccx") is None, reason="CalculiX is not installed")
def test_without_joints_the_decks_own_solver_agrees(api: httpx.Client, bare: str) -> None:
    """In short the test above, and the solver's in `tests/unit/formats/models/test_write_inp.py`."""
    sent(api, bare, deck(), units="m-N-kg")
    content, recipe = measured(boundary="cantilever"), {"junctions": "off"}
    address, result = updated(api, bare, content, "as_modelled", recipe)
    after = say_that_joints_lack(api, address, result)
    head = [line for line in after.decode().splitlines() if line.startswith("** ")]
    expected = [
        float(line.split(" Hz")[0].split()[-1]) for line in head if line.startswith("** mode ")
    ]
    ratios = np.divide(*(frequencies(ccx(each.decode().splitlines())) for each in (after, deck())))
    modes = [mode for mode in result["modes"] if mode["updated_hz"]]
    numbers = [int(np.argmin(np.abs(np.array(expected) - mode["own_mesh_hz"]))) for mode in modes]
    assert len(modes) >= 6
    ours = [mode["updated_hz"] / mode["initial_hz"] for mode in modes]
    np.testing.assert_allclose(ratios[numbers], ours, rtol=0.002)


def test_points_off_the_model_are_listed_also_at_import_and_it_has_no_edges_to_clamp(
    api: httpx.Client, bare: str
) -> None:
    sent(api, bare, deck(), units="m-N-kg")

    def campaign(**fields: Any) -> str:
        body = {"name": "c", "boundary": "free", **fields}
        return str(ok(api.post(f"structures/{bare}/campaigns", json=body), 201)["id"])

    made = campaign()
    assert ok(api.get(f"campaigns/{made}/alignment"), 200) == {
        "rms_m": None,
        "off": [],
        "items": [],
    }
    places = {**points(), 90: (0.2, 0.0, 0.0)}
    items = [{"label": n, "x_m": x, "y_m": y, "z_m": z} for n, (x, y, z) in places.items()]
    ok(api.put(f"campaigns/{made}/grid-points", json={"items": items}, headers={"If-Match": "*"}))
    alignment = ok(api.get(f"campaigns/{made}/alignment"), 200)
    assert alignment["off"] == [90]
    by_label = {each["label"]: each for each in alignment["items"]}
    assert (by_label[1]["set"], by_label[2]["set"]) == ("flange", "web")
    assert by_label[1]["distance_m"] == pytest.approx(0.002)
    assert [abs(n) for n in by_label[2]["normal"]] == pytest.approx([0, 1, 0])
    assert by_label[90]["distance_m"] == pytest.approx(0.028)

    few, ones = Axis(5.0, 0.5, 8), np.ones(8, complex)
    content = [GridPoint(n, xyz) for n, xyz in points().items()]
    content += [Frf(0, "", ("",) * 5, n, 3, 1, 3, "accelerance", few, ones) for n in points()]
    file = b"".join(encode(content))
    for shift, count in ((0.0, 0), (0.01, 1)):
        frame = {"origin_m": [0, shift, 0], "x_axis": [1, 0, 0], "y_axis": [0, 1, 0]}
        moved = campaign(name=f"{shift}", frame=frame)
        queued = api.post(f"campaigns/{moved}/imports", params={"filename": "a.uff"}, content=file)
        warnings = [
            each
            for each in finished(api, queued.headers["Location"])["warnings"]
            if "off the specimen" in each
        ]
        listed = ok(api.get(f"campaigns/{moved}/alignment"), 200)["off"]
        assert (len(warnings), bool(listed)) == (count, bool(count))
        assert all(f": {', '.join(map(str, listed))};" in each for each in warnings)

    held = campaign(boundary="cantilever")
    problem = ok(api.post(f"campaigns/{held}/update-jobs", json={}), 422)
    assert "as_modelled" in problem["detail"]


def test_versions_go_to_and_fro(api: httpx.Client, project: str, bare: str) -> None:
    first = sent(api, bare, deck(), units="m-N-kg")
    edit = {"If-Match": api.get(f"structures/{bare}").headers["ETag"]}
    flat = {"length_m": 0.5, "width_m": 0.04, "thickness_m": 0.01}
    strip = ok(api.patch(f"structures/{bare}", json={"geometry": flat}, headers=edit), 200)
    assert (strip["version"], strip["model"], strip["replaced"]) == (3, None, ["model"])
    edit = {"If-Match": api.get(f"structures/{bare}").headers["ETag"]}
    back = ok(api.patch(f"structures/{bare}", json={"model": first["id"]}, headers=edit), 200)
    assert (back["version"], back["model"], back["geometry"]) == (4, first["id"], None)
    assert back["replaced"] == ["geometry"]
    other = ok(api.post(f"projects/{project}/structures", json={"name": "other"}), 201)["id"]
    edit = {"If-Match": api.get(f"structures/{other}").headers["ETag"]}
    problem = ok(api.patch(f"structures/{other}", json={"model": first["id"]}, headers=edit), 422)
    assert "no model that was read for this structure" in problem["detail"]


@pytest.mark.parametrize("kind", ["panel", *map(long, ("i", "box", "channel", "angle"))])
def test_the_open_decks_are_read_as_they_are(api: httpx.Client, bare: str, kind: str) -> None:
    content = shared_file("BLIND_OPEN", "blind-open", f"structures/{kind}-1.inp").read_bytes()
    model = sent(api, bare, content, units="m-N-kg", filename=f"{kind}-1.inp")
    assert model["status"] == "succeeded", model["message"]
    assert {each["name"] for each in model["found"]["sets"]} == {"flange", "web"}
    assert model["found"]["junctions"]


def test_the_same_deck_of_several_clients_at_once_is_read_once(
    api: httpx.Client, bare: str
) -> None:
    headers, path = {"Content-Type": "application/octet-stream"}, f"structures/{bare}/model"
    query = {"filename": "beam.inp", "units": "m-N-kg"}

    def send(_: int = 0) -> httpx.Response:
        return api.post(path, content=deck(), params=query, headers=headers)

    with ThreadPoolExecutor(8) as pool:
        answers = list(pool.map(send, range(8)))
    assert sorted(answer.status_code for answer in answers) == 7 * [200] + [202]
    (model,) = {ok(answer)["id"] for answer in answers}
    assert finished(api, f"/api/v1/models/{model}")["status"] == "succeeded"
    again = send()  # the structure is this model now
    assert (again.status_code, ok(again)["id"]) == (200, model)
    assert [one["id"] for one in ok(api.get(f"structures/{bare}/models"), 200)["items"]] == [model]
