"""What is lost with cards that are not used."""

from __future__ import annotations

from modalbase.formats.models.inp.lines import Card, Row
from modalbase.formats.models.model import Ignored

_HARMLESS = {
    "requests for output": (
        "OUTPUT NODEOUTPUT ELEMENTOUTPUT ENERGYOUTPUT CONTACTOUTPUT INTEGRATEDOUTPUT INTEGRATEDOUTPUTSECTION "
        "MODALOUTPUT MODALFILE NODEPRINT ELPRINT NODEFILE ELFILE CONTACTFILE CONTACTPRINT ENERGYPRINT ENERGYFILE "
        "FACEPRINT FILEOUTPUT FILEFORMAT PREPRINT PRINT RESTART MONITOR SECTIONPRINT SECTIONFILE TIMEPOINTS "
        "NODEOUT FILTER ELEMENTMATRIXOUTPUT MATRIXGENERATE MATRIXOUTPUT SURFACEPROPERTY WAVEFRONTMINIMIZATION "
        "FILE RESULTSFILE SURFACESECTION"
    ),
    "loads: modes have none": (
        "CLOAD DLOAD DSLOAD AMPLITUDE TEMPERATURE FIELD CFLUX DFLUX DSFLUX FILM SFILM RADIATE SRADIATE "
        "BASEMOTION BASELINECORRECTION INERTIARELIEF PHYSICALCONSTANTS INITIALCONDITIONS PSDDEFINITION "
        "CORRELATION LOADCASE SURFACELOAD BOUNDARYF MASSFLOW DEFINEPLATE SPECTRUM PREDEFINEDFIELD"
    ),
    "steps other than those of modes": (
        "STATIC DYNAMIC BUCKLE STEADYSTATEDYNAMICS MODALDYNAMIC HEATTRANSFER VISCO COMPLEXFREQUENCY "
        "SELECTEIGENMODES CONTROLS COUPLEDTEMPERATUREDISPLACEMENT COUPLEDTEMPERATURE-DISPLACEMENT "
        "UNCOUPLEDTEMPERATURE-DISPLACEMENT RANDOMRESPONSE RESPONSESPECTRUM SOLVERCONTROLS SUBSTRUCTUREGENERATE "
        "SENSITIVITY OBJECTIVE DESIGNVARIABLES GREEN ELECTROMAGNETICS STEADYSTATETRANSPORT ANNEAL "
        "CRACKPROPAGATION DIRECTCYCLIC GEOSTATIC CFD"
    ),
    "damping: it is measured": "MODALDAMPING GLOBALDAMPING DASHPOT DAMPING CONTACTDAMPING DAMPINGCONTROLS VISCOUS",
    "heat": (
        "EXPANSION CONDUCTIVITY SPECIFICHEAT LATENTHEAT ELECTRICALCONDUCTIVITY MAGNETICPERMEABILITY "
        "GAPCONDUCTANCE FLUIDCONSTANTS SPECIFICGASCONSTANT GAPHEATGENERATION FLUIDSECTION DISTRIBUTIONTABLE"
    ),
    "what a material does beyond small motions": (
        "PLASTIC CREEP CYCLICHARDENING FAILSTRESS FAILSTRAIN DAMAGEINITIATION DAMAGEEVOLUTION "
        "DAMAGESTABILIZATION DEPVAR VISCOELASTIC DEFORMATIONPLASTICITY RATEDEPENDENT USEROUTPUTVARIABLES "
        "POTENTIAL MOHRCOULOMB MOHRCOULOMBHARDENING DRUCKERPRAGER COMPRESSIVEFAILURE CONCRETEDAMAGEDPLASTICITY "
        "FRACTURECRITERION"
    ),
    "properties of contact": (
        "SURFACEINTERACTION SURFACEBEHAVIOR FRICTION CHANGEFRICTION CHANGESURFACEBEHAVIOR CHANGECONTACTTYPE "
        "CONTACTCONTROLS CONTACTINITIALIZATIONASSIGNMENT CONTACTINITIALIZATIONDATA CONTACTPROPERTYASSIGNMENT "
        "CONTACTINCLUSIONS CONTACTEXCLUSIONS CONTACTFORMULATION CONTACTSTABILIZATION CLEARANCE "
        "SURFACEPROPERTYASSIGNMENT COHESIVEBEHAVIOR"
    ),
    "controls of elements": "SECTIONCONTROLS HOURGLASSSTIFFNESS ENRICHMENT",
    "names": "HEADING SURFACE DISTRIBUTION MEMBRANE VALUESATINFINITY",
}
_CHANGES = {
    "contact: what touches is not joined": "CONTACT CONTACTPAIR GAP GAPELEMENT TIEDCONTACT",
    "normals of their own: those of the mesh are taken": "NORMAL",
    "the transverse shear stiffness: that of the material is taken": "TRANSVERSESHEARSTIFFNESS TRANSVERSESHEAR",
    "joints between nodes": (
        "CONNECTORSECTION CONNECTORELASTICITY CONNECTORBEHAVIOR CONNECTORDAMPING CONNECTORMOTION FASTENER "
        "FASTENERPROPERTY JOINT JOINTELASTICITY BEAMSECTIONOFFSET RELEASE"
    ),
    "a constraint": (
        "EMBEDDEDELEMENT SHELLTOSOLIDCOUPLING CYCLICSYMMETRYMODEL PRETENSIONSECTION PRE-TENSIONSECTION "
        "DISPLAYBODY MULTIPOINTCONSTRAINT TRUSSSECTION ELEMENTTIE NETWORKMPC SUBMODEL"
    ),
    "reinforcement": "REBARLAYER REBAR EMBEDDEDREGION",
    "a change of shape or of what is there": "IMPERFECTION MODELCHANGE MASSADJUST MASSSCALING FIXEDMASSSCALING",
    "stiffness or mass given by numbers": (
        "MATRIXINPUT MATRIXASSEMBLE USERELEMENT UELPROPERTY MATRIX SUBSTRUCTUREPROPERTY SUBSTRUCTUREPATH "
        "NONSTRUCTURALMASS ADDEDMASS POINTMASS SOLIDSECTION MEMBRANESECTION"
    ),
}
_LOSSES = {name: (loss, False) for loss, names in _HARMLESS.items() for name in names.split()}
_LOSSES |= {name: (loss, True) for loss, names in _CHANGES.items() for name in names.split()}


class Losses:
    """Cards that were not used, gathered by name and loss."""

    def __init__(self) -> None:
        self._lines: dict[tuple[str, str, bool], list[int]] = {}

    def add(self, where: Card | Row, loss: str, *, changes: bool) -> None:
        """Note a card, or a line of one."""
        label = where.label if isinstance(where, Card) else where.card
        self._lines.setdefault((label.upper(), loss, changes), []).append(where.line)

    def unused(self, card: Card) -> None:
        """Note a card by what is known of it; one that is unknown may change modes."""
        unknown = "unknown to this reader; it may be a stiffness, a mass or a constraint", True
        loss, changes = _LOSSES.get(card.name, unknown)
        if card.name == "INITIALCONDITIONS" and card.get("TYPE").upper() == "STRESS":
            loss, changes = "stresses, which stiffen", True
        self.add(card, loss, changes=changes)

    @property
    def found(self) -> tuple[Ignored, ...]:
        """All, those that change modes first."""
        every = [Ignored(card, tuple(lines), loss, changes) for (card, loss, changes), lines in self._lines.items()]
        return tuple(sorted(every, key=lambda each: not each.changes))
