"""All that a reader of models may say is lost, by its id: of cards that it does not use, or not as
their solver would.
"""

from typing import NamedTuple


class Loss(NamedTuple):
    """A row of the table; with names for values in braces."""

    loss: str  # what is lost, in a sentence
    # whether modes and frequencies change; such a card stops an import unless the user accepts it
    # by name
    changes: bool = False
    card: str = "{card}"  # under which name it is noted


_RIGID_IN_SHEAR = "the deck has it rigid in transverse shear; here it shears"

OF_BDF = {
    "card_not_used": Loss("not used: {what}"),
    "card_left_out": Loss("not used: {what}", True),
    "card_unknown": Loss("not used: a card that is not known here", True),
    "grid_twice": Loss("it says what another has said, as MSC Nastran allows", card="GRID twice"),
    "superelement": Loss("superelements are read as one model", card="GRID SEID"),
    "dmig": Loss("stiffness and mass by matrices are not used", True, "DMIG"),
    "dmig_not_selected": Loss("matrices that the deck does not select are not used", card="DMIG"),
    "integers_for_reals": Loss(
        "read as the same number; Nastran asks for a decimal point", card="integers for reals"
    ),
    "without_end": Loss(
        "the deck ends without it, as MSC Nastran allows; is it whole?", card="ENDDATA"
    ),
    "param": Loss("settings of the solver are not used", card="PARAM"),
    "k6rot": Loss(
        "the stiffness against rotation about the normal is ours, 0.01 G t", True, "PARAM K6ROT"
    ),
    # of shells
    "pshell_without_mid1": Loss(
        "it bends alone in the deck; here it stretches too", True, "PSHELL without MID1"
    ),
    "pshell_without_mid2": Loss(
        "it is a membrane in the deck; here it bends too", True, "PSHELL without MID2"
    ),
    "pshell_with_mid2": Loss(
        "bending by a material of its own is lost", True, "PSHELL with MID2, MID4"
    ),
    "pshell_of_plane_strain": Loss(
        "plane strain; here it is plane stress", True, "PSHELL with MID2 = -1"
    ),
    "pshell_inertia": Loss("it bends as a plate of its thickness here", True, "PSHELL 12I/T**3"),
    "pshell_without_mid3": Loss(_RIGID_IN_SHEAR, card="PSHELL without MID3"),
    "pshell_shear": Loss(
        "it shears as a plate of MID1 with TS/T = 5/6 here", True, "PSHELL MID3, TS/T"
    ),
    "laminate_option": Loss(
        "the laminate is read with all of its stiffness", True, "{card} LAM={lamina}"
    ),
    "mat1_one_constant": Loss(
        "Nastran takes the other two as 0 then; here ν = 0 and E = 2 G",
        True,
        "MAT1 with E or G alone",
    ),
    "mat1_inconsistent": Loss(
        "E, G and ν do not fit one another; as in Nastran shells take E and ν, and G across, and bars"
        " E and G",
        card="MAT1 with E, G, NU",
    ),
    "prestress_of_subcase": Loss("a static load case that stiffens or softens", True, "STATSUB"),
    "mat8_without_shear": Loss(f"{_RIGID_IN_SHEAR} with G12 there", card="MAT8 without G1Z, G2Z"),
    "mat2_coupling": Loss(
        "the coupling of stretch and shear is lost; use MAT8 with an angle",
        True,
        "MAT2 with G13, G23",
    ),
    # of beams
    "beam_without_inertia": Loss(
        "it resists there with {least:g} of a round bar of its area, not with none",
        card="{card} without I or J",
    ),
    "beam_shear": Loss(
        "one of both is rigid in shear; here neither is flexible", card="{card} K1, K2"
    ),
    "tube_tapers": Loss("the tube is read with the diameter of its first end", True, "PTUBE OD2"),
    "pbeaml_tapers": Loss("it is read with the section of its end A", True, "PBEAML that tapers"),
    "pbeam_tapers": Loss("it is read with its mean section", True, "PBEAM that tapers"),
    "shear_centre": Loss(
        "the neutral axis lies where it does; that the section turns about another line is lost",
        True,
        "{card} with its shear centre aside",
    ),
    "mass_off_axis": Loss("non-structural mass stands on the neutral axis", True, "PBEAM M1, M2"),
    # of what is carried and held
    "spring_askew": Loss(
        "its second end acts along the first one's direction", True, "{card} askew"
    ),
    "bush_mass_at_ground": Loss(
        "half of the mass M of a bush to the ground moves with its grid",
        True,
        "PBUSH M to the ground",
    ),
    "mass_not_selected": Loss(
        "non-structural mass that the deck does not select is not used",
        card="{card} of another set",
    ),
    "mass_by_kind": Loss("non-structural mass by {what} is not used", True),
    "rbar": Loss(
        "a rigid bar that both ends lead in part is not used", True, "RBAR led by both ends"
    ),
    "rbe1": Loss("a rigid body that several grids lead is not used", True, "RBE1 led by several"),
    "rbe3_components": Loss(
        "leaders are read with all three displacements", True, "RBE3 without C = 123"
    ),
    "rbe3_rotations": Loss("leaders are read without their rotations", card="RBE3 with C = 123456"),
    "set_not_selected": Loss(
        "constraints of sets that the deck does not select are not used",
        card="{card} of another set",
    ),
    "set_of_subcase": Loss(
        "the modes are read with {card} = {selected}, not {other}", card="{card} of another subcase"
    ),
    "sets_not_selected": Loss(
        "nothing selects one of the sets {sets}; all of them hold here", True
    ),
    "set_missing": Loss(
        "{who} {card} = {missing}, which is not in the deck; nothing is held by it", True
    ),
}
"""Of decks of Nastran."""

OF_INP = {
    "keyword_not_used": Loss("{what}"),
    "keyword_left_out": Loss("{what}", True),
    "keyword_unknown": Loss(
        "unknown to this reader; it may be a stiffness, a mass or a constraint", True
    ),
    "initial_stress": Loss("stresses, which stiffen", True),
    "spring_not_linear": Loss("a spring that is not linear", True),
    "spread_mass": Loss(
        "spread mass on part of a set, on shells and beams at once, or in other units", True
    ),
    "constraint_of_type": Loss("a constraint of type {type} between nodes", True),
    "nodes_apart": Loss("{type} between nodes that are apart", True),
    "rot_node": Loss("the ROT NODE: supports and masses that act on it", True),
    "moved_reference": Loss(
        "the REF NODE moves to the centre of mass; here it stays where it is", True
    ),
    "node_normals": Loss(
        "normals of their own behind the coordinates: those of the mesh are taken", True
    ),
    "weights_by_distance": Loss("weights that fall with the distance: all are taken alike", True),
    "equation": Loss(
        "an equation between sets of several nodes, or with dofs above 6; write it node by node",
        True,
    ),
    "tie": Loss("a tie of {count} node(s) that lie on no node of the other surface", True),
    "driven_motion": Loss("motion that another model prescribes", True),
    "dofs_above_6": Loss("dofs above 6, such as temperature"),
    "prestress": Loss("a state of stress before the modes, which stiffens or softens", True),
    "later_step": Loss("modes of a later step: what the first with *FREQUENCY holds is taken"),
    "other_temperatures": Loss(
        "constants at other temperatures: those of the first line are taken", True
    ),
    "section_parameter": Loss("the parameter {parameter} of a section", True),
    "circ": Loss(
        "whether CIRC states a radius, as Abaqus has it and is taken, or a diameter, as CalculiX"
        " does",
        True,
    ),
}
"""Of decks of Abaqus and CalculiX."""

OF_MODELS = {
    "massless": Loss("{material} has none: its elements weigh nothing", card="density"),
    "lines_of_mesh": Loss("{count} lines; beams of a mesh are not read, edges are no loss", True),
}
"""Of meshes, and of models of any format."""

LOSSES = {**OF_BDF, **OF_INP, **OF_MODELS}
"""All of them."""
