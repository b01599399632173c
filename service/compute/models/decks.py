"""The user's own deck with updated numbers, and what its own solver will say of it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from fecore.arrays import FloatArray
from fecore.body.structure import SIZES, Structure
from fecore.dynamics.bodies import body_modes
from fecore.quantities import kind_of
from fecore.updating.mesh import on_finer_mesh
from modalbase.formats.models.model import BeamSection, FiniteElementModel
from modalbase.formats.models.units import UnitSystem, in_si, unit_of, units_of
from modalbase.formats.models.write import write_deck
from service.compute.models.bodies import body_of_model
from service.compute.models.reading import faults_of, parsed, repacked, unpacked


@dataclass(frozen=True)
class DeckOrder:
    """What a deck is to say."""

    content: bytes  # the deck as it was sent
    filename: str  # as its sender called it
    units: str  # that its numbers are in
    boundary: str  # of the campaign
    constants: Mapping[str, float]  # updated, SI, by name such as `flange.E1`
    modes: int  # so many are listed
    with_joints: bool  # whether the constants were found with a model of the joints of walls
    remarks: tuple[str, ...]  # for its head


def updated_deck(order: DeckOrder) -> bytes:
    """The deck with updated numbers, each with a comment; every other byte stays.

    Raises:
        Invalid: a number does not stand in the deck.
    """
    model = parsed(order.content, order.filename)
    remarks = [*order.remarks, *_joints(in_si(model, order.units), order)]
    updated = _in_deck(model, order.constants, units_of(order.units))
    deck = unpacked(order.content, order.filename)
    changed = faults_of(
        lambda: write_deck(deck.content, model, updated, included=deck.included, remarks=remarks)
    )
    return repacked(order.content, order.filename, changed)


def _in_deck(
    model: FiniteElementModel, constants: Mapping[str, float], units: UnitSystem
) -> dict[tuple[str, str], float]:
    """Constants in the deck's units by set and name; no G of a beam whose isotropic material states
    none.
    """
    scaled = {}
    for full, value in constants.items():
        name, _, constant = full.rpartition(".")
        section = model.sections.get(name)
        if section is None:
            continue
        first = model.materials[section.materials[0]]
        if not (
            isinstance(section, BeamSection)
            and first.is_isotropic
            and constant == "G"
            and "G" not in first.places
        ):
            scaled[name, constant] = value / unit_of(kind_of(constant), units)
    return scaled


def _joints(model: FiniteElementModel, order: DeckOrder) -> list[str]:
    """What a solver is expected to find, mode by mode, as its own model has none of the joints of
    walls.
    """
    body = replace(body_of_model(model, order.boundary), with_joints=order.with_joints)
    as_sent = replace(
        order,
        constants={name: value for name, value in order.constants.items() if name not in SIZES},
    )
    plain, _ = _frequencies(replace(body, with_joints=False), as_sent)  # the deck's nodes stay
    own, finer = _frequencies(body, order)
    if not body.with_joints:
        notes = [
            "the constants were found without a model of the joints of walls, as this deck has none"
        ]
    elif body.junctions:
        notes = [
            "the constants were found with a model of the joints of walls, which this deck has not"
        ]
    else:
        notes = ["no walls meet at an angle: this model and the solver's differ by elements alone"]
    right, where = (own, "") if finer is None else (finer, " on a finer mesh")
    if body.junctions and body.with_joints:
        where += " with joints"
    if not where:
        return [*notes, *(f"mode {k}: expected {hz:.6g} Hz" for k, hz in enumerate(plain, start=1))]
    if finer is not None:
        notes.append("and without the error of this mesh, which is stated mode by mode")
    for k, (hz, mesh, of_body) in enumerate(zip(plain, own, right, strict=True), start=1):
        row = (
            f"mode {k}: expected {hz:.6g} Hz, {100 * (hz / of_body - 1):+.2f} % from {of_body:.6g}"
            f" Hz{where}"
        )
        notes.append(
            row
            if finer is None
            else f"{row}; by the mesh {round(100 * (mesh / of_body - 1), 2) + 0.0:+.2f} %"
        )
    return notes


def _frequencies(body: Structure, order: DeckOrder) -> tuple[FloatArray, FloatArray | None]:
    """The lowest elastic natural frequencies with the updated constants, Hz, and those on a finer
    mesh.
    """
    known = {
        **body.nominal,
        **{name: value for name, value in order.constants.items() if name in body.nominal},
    }
    q, model = np.array(list(known.values())), body.model
    springs = np.array(
        [order.constants.get(spring.name, spring.stiffness) for spring in body.springs]
    )
    K = model.stiffness.at(np.concatenate([body.stiffness_coefficients(q), springs]))
    modes = body_modes(model, K, model.mass.at(body.mass_coefficients(q)), order.modes)
    return modes.frequency_hz[modes.rigid :], on_finer_mesh(body, modes, q, springs)
