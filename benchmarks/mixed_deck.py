"""A user's deck of mixed elements: a stiffened tube of CQUAD4, CTRIA3, CBEAM, RBE2 and CONM2, as of
an aeroelastic wing, from file to update.
"""

import resource
import time
from itertools import count

import numpy as np

from benchmarks.tables import print_beside
from fecore.arrays import FloatArray
from fecore.body.constants import Parameter
from fecore.body.structure import Structure
from fecore.frf import Dof, FrfSet
from fecore.updating.forward import ForwardModel
from fecore.updating.measurement import Measurement
from fecore.updating.parameters import parametrise
from fecore.updating.pipeline import update
from fecore.updating.recipe import Recipe
from modalbase.formats.models.bdf import read_bdf
from modalbase.formats.models.units import in_si
from service.compute.models.bodies import AS_MODELLED, body_of_model
from tests.support.draws import noisy

LENGTH, WIDTH, HEIGHT = 2.0, 0.4, 0.12
CORNERS = (0, 28, 35, 63)  # of 70 nodes around the tube: skins of 28 elements, webs of 7
TRUTH = {"pshell_1.E1": 74e9, "pshell_2.E1": 66e9, "pbeam_3.E": 71e9}
A0, A1, NOISE = 4.0, 4e-6, 0.01


def around() -> FloatArray:
    """(70, 2) y and z of the nodes of a section, from the lower edge of the front web along the
    lower skin.
    """
    found = []
    sides = ((28, (1, 0)), (7, (0, 1)), (28, (-1, 0)), (7, (0, -1)))
    place = np.array([-WIDTH / 2, -HEIGHT / 2])
    for number, (along, up) in sides:
        step = np.array([along * WIDTH / 28, up * HEIGHT / 7])
        found += [place + k * step for k in range(number)]
        place = place + number * step
    return np.array(found)


def deck(stations: int = 100) -> bytes:
    """Aluminium tube of 70 nodes a station, beams along corners and skins, a store of 2 kg on a
    rigid link, the root clamped.

    By default 7,001 nodes, 6,930 places for quadrilaterals of which 550 are two triangles each, and
    594 beams.
    """
    section, ring = around(), len(around())
    lines = [
        "SOL 103",
        "CEND",
        "SPC = 1",
        "BEGIN BULK",
        "MAT1,1,7.+10,,0.33,2700.",
        "MAT1,2,7.+10,,0.33,2700.",
    ]
    lines += ["MAT1,3,7.+10,,0.33,2700.", "PSHELL,1,1,0.003,1,,1", "PSHELL,2,2,0.004,2,,2"]
    lines += ["PBEAM,3,3,1.2-4,4.0-9,4.0-9,,3.0-9"]
    for i, x in enumerate(np.linspace(0, LENGTH, stations)):
        lines += [
            f"GRID,{ring * i + j + 1},,{x:.6f},{y:.6f},{z:.6f}" for j, (y, z) in enumerate(section)
        ]
    store = ring * stations + 1
    lines.append(f"GRID,{store},,{0.7 * LENGTH:.6f},0.,{-HEIGHT / 2 - 0.1:.6f}")
    numbers = count(1)
    for i in range(stations - 1):
        for j in range(ring):
            a, b = ring * i + j + 1, ring * i + (j + 1) % ring + 1
            c, d, wall = (
                b + ring,
                a + ring,
                2 if CORNERS[1] <= j < CORNERS[2] or j >= CORNERS[3] else 1,
            )
            # a mesher's triangles among the quadrilaterals
            if wall == 1 and (i + j) % 9 == 0 and i % 9 < 8:
                lines += [
                    f"CTRIA3,{next(numbers)},{wall},{a},{d},{c}",
                    f"CTRIA3,{next(numbers)},{wall},{a},{c},{b}",
                ]
            else:
                lines.append(f"CQUAD4,{next(numbers)},{wall},{a},{d},{c},{b}")
        for j in (*CORNERS, 14, 49):
            here = ring * i + j + 1
            lines.append(f"CBEAM,{next(numbers)},3,{here},{here + ring},0.,0.,1.")
    at = ring * round(0.7 * (stations - 1)) + 1
    feet = ",".join(str(at + j) for j in (7, 14, 21))
    lines += [f"RBE2,{next(numbers)},{store},123456,{feet}", f"CONM2,{next(numbers)},{store},,2.0"]
    lines += [f"SPC1,1,123456,1,THRU,{ring}", "ENDDATA", ""]
    return "\n".join(lines).encode()


def measured(body: Structure, seed: int = 0) -> Measurement:
    """FRFs of the body with other moduli, at 45 points along its skins and webs, two
    accelerometers, 1 % noise.
    """
    nodes = body.mesh.nodes
    stations = len(nodes) // 70
    rows = 70 * np.linspace(stations / 10, stations - 1, 9).astype(int)[:, None] + np.array(
        [4, 14, 24, 31, 66]
    )
    normal = np.tile([3, 3, 3, 2, 2], 9)
    points = {n + 1: tuple(map(float, nodes[row])) for n, row in enumerate(rows.ravel())}
    hits = [Dof(n, int(axis)) for n, axis in zip(points, normal, strict=True)]
    prior = parametrise(body, [Parameter(name, prior_mean=value) for name, value in TRUTH.items()])
    forward = ForwardModel.of_dofs(prior, hits, points, 400.0)
    pairs = [(sensor, hit) for sensor in (hits[-5], hits[-2]) for hit in hits]
    model = forward.solve(prior.prior_mean).frf_model(*zip(*pairs, strict=True), with_strain=False)
    hz = np.arange(5.0, 400.0, 0.25)
    values = model.synthesise(hz, A0 + A1 * model.eigenvalue, "accelerance")
    values = noisy(values, NOISE, np.random.default_rng(seed))
    return Measurement(FrfSet(hz, values, *zip(*pairs, strict=True), "accelerance"), points)


def mixed_deck(stations: int = 100) -> None:
    """A deck of 8,000 mixed elements from file to update; CPU seconds of each step."""
    times = [time.process_time()]

    def lap(what: str) -> None:
        times.append(time.process_time())
        print(f"  {what}: {times[-1] - times[-2]:.2f} s CPU", flush=True)

    content = deck(stations)
    model = in_si(read_bdf(content), "m-N-kg")
    elements = sum(len(each.nodes) for each in model.elements)
    lap(
        f"read {len(content) / 1e6:.1f} MB, {len(model.nodes)} nodes, {elements} elements,"
        f" {len(model.links)} links"
    )
    body = body_of_model(model, AS_MODELLED)
    print(
        f"  sets {', '.join(body.mesh.sets)}; {len(body.junctions)} junctions,"
        f" {body.model.stiffness.size} dofs"
    )
    lap("model and its joints")
    measurement = measured(body)
    lap("simulate FRFs")
    result = update(measurement, body, Recipe(damping_models=("rayleigh",)))
    lap("update by {}")
    print_beside(result, TRUTH)
    print(f"  peak {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6:.2f} GB")
