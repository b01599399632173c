"""Spectra out of the database: streamed, verified, cut to a band and stride; and a campaign as the
core takes it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, TypeVar
from uuid import UUID

import numpy as np
from numpy.typing import NDArray
from sqlalchemy import select
from sqlalchemy.orm import Session

from fecore.arrays import ComplexArray, FloatArray
from fecore.frf import Dof, FrfSet
from modalbase.formats.frfs import Frfs, table
from service.compute.frame import Frame
from service.compute.spectra import FrequencyAxis, Spectrum, decode
from service.nouns.campaigns.operations import campaign_of, frame_of, stored_points
from service.nouns.campaigns.schemas import AddedMass, CampaignInputs, Instruments
from service.nouns.frfs.operations import Frf, frf_for
from service.nouns.structures.operations import present_structure
from service.nouns.structures.schemas import StructureIn
from service.platform.db.bytea import stream_rows
from service.platform.errors import Conflict, Invalid

if TYPE_CHECKING:
    from service.nouns.campaigns.operations import Campaign


Values = NDArray[np.complexfloating]
Written = TypeVar("Written", bound=table.FrfTable)


def require_order(fmin: float | None, fmax: float | None) -> None:
    """Refuse a band whose ends are the wrong way round.

    Raises:
        Invalid: they are.
    """
    if fmin is not None and fmax is not None and fmin > fmax:
        raise Invalid("fmin", f"is {fmin:g} Hz and above fmax, {fmax:g} Hz")


@dataclass(frozen=True)
class Cut:
    """Which lines of a spectrum: from `fmin` to `fmax`, Hz, both included, every `stride`-th of
    them.
    """

    fmin: float | None = None
    fmax: float | None = None
    stride: int = 1

    def lines(self, frequency_hz: FloatArray) -> slice:
        """The slice of these frequency lines that the cut keeps.

        Args:
            frequency_hz: (L,) increasing, Hz.

        Raises:
            Invalid: no line is left.
        """
        low = -np.inf if self.fmin is None else self.fmin
        high = np.inf if self.fmax is None else self.fmax
        first, end = (
            np.searchsorted(frequency_hz, low),
            np.searchsorted(frequency_hz, high, side="right"),
        )
        if first == end:
            raise Invalid(
                "fmin",
                f"no line lies in {low:g} to {high:g} Hz; the lines go from {frequency_hz[0]:g} to"
                f" {frequency_hz[-1]:g} Hz",
            )
        return slice(int(first), int(end), self.stride)


@dataclass(frozen=True)
class FrfTable:
    """FRFs on one frequency axis, spectra still in the database; `modalbase.formats.frfs` writes
    it.
    """

    session: Session  # where the spectra are read
    frfs: Sequence[Frf]  # N rows without their spectra
    frequency_hz: FloatArray  # (L,) the lines that are wanted
    lines: slice  # where they are in the stored spectra

    @property
    def quantity(self) -> str:
        """Accelerance, mobility or receptance."""
        return self.frfs[0].quantity

    @property
    def dtype(self) -> np.dtype[np.complexfloating]:
        """The narrowest complex type that holds all spectra."""
        return np.result_type(*{frf.dtype for frf in self.frfs})

    @property
    def has_coherence(self) -> bool:
        """Whether any of the FRFs has one."""
        return any(frf.coherence_sha256 is not None for frf in self.frfs)

    @property
    def description(self) -> str:
        """A second line beside each label, in files that have one."""
        return "NONE"

    @property
    def points(self) -> Mapping[int, tuple[float, float, float]]:
        """Label to coordinates of the campaign's points, m."""
        return stored_points(self.session, self.frfs[0].campaign_id)

    def spectra(self) -> Iterator[tuple[Frf, Values]]:
        """Each FRF with its (L,) values, in order."""
        for frf, data in _stream(self.session, self.frfs, "data"):
            yield frf, self._spectrum(frf, data)

    def coherences(self) -> Iterator[tuple[Frf, FloatArray | None]]:
        """Each FRF with its (L,) coherence γ², or None."""
        for frf, data in _stream(self.session, self.frfs, "coherence"):
            yield frf, self._coherence(frf, data)

    def both(self) -> Iterator[tuple[Frf, Values, FloatArray | None]]:
        """Each FRF with its values and its coherence."""
        if not self.has_coherence:
            yield from ((frf, values, None) for frf, values in self.spectra())
            return
        for frf, data, coherence in _stream(self.session, self.frfs, "data", "coherence"):
            yield frf, self._spectrum(frf, data), self._coherence(frf, coherence)

    def of_hits(self, name: Literal["variance", "growth"]) -> ComplexArray | None:
        """(N, L) variance of the FRFs, or their growth, that their hits showed; None where one has
        none.
        """
        dtype: Literal["<f8", "<c8"] = "<f8" if name == "variance" else "<c8"
        digests = {frf.id: getattr(frf, f"{name}_sha256") for frf in self.frfs}
        if None in digests.values():
            return None
        return np.array(
            [
                decode(Spectrum(dtype, frf.lines, data, digests[frf.id]))[self.lines]
                for frf, data in _stream(self.session, self.frfs, name)
            ],
            dtype=complex,
        )

    def _spectrum(self, frf: Frf, data: bytes) -> Values:
        spectrum = Spectrum(frf.dtype, frf.lines, data, frf.sha256)  # type: ignore[arg-type]
        return np.asarray(decode(spectrum)[self.lines], dtype=frf.dtype)

    def _coherence(self, frf: Frf, data: bytes | None) -> FloatArray | None:
        if data is None:
            return None
        assert frf.coherence_sha256 is not None
        spectrum = Spectrum(frf.coherence_dtype, frf.lines, data, frf.coherence_sha256)  # type: ignore[arg-type]
        return decode(spectrum)[self.lines].real.astype(np.float64)


@dataclass(frozen=True, eq=False, kw_only=True)
class PredictedTable(Frfs):
    """FRFs of a model, in memory, which are written like measured ones."""

    description: str  # whose they are, in words
    # label to coordinates of the points, m
    points_of: Callable[[], Mapping[int, tuple[float, float, float]]]

    @property
    def points(self) -> Mapping[int, tuple[float, float, float]]:
        """Label to coordinates of the points, m."""
        return self.points_of()


def frequency_axis(session: Session, frf: Frf) -> FloatArray:
    """The frequency lines of an FRF, (L,), Hz: from start, step and count, or the stored array
    where the axis is uneven.
    """
    stored = (
        None
        if frf.step_hz is not None
        else session.scalars(select(Frf.axis).where(Frf.id == frf.id)).one()
    )
    return FrequencyAxis(frf.start_hz, frf.step_hz, frf.lines, stored).frequency_hz()


def make_tables(session: Session, frfs: Sequence[Frf], cut: Cut) -> list[FrfTable]:
    """FRFs as tables of one quantity and one frequency axis each, in the order of their first rows.

    Raises:
        Invalid: the cut leaves no line.
    """
    groups: dict[tuple[object, ...], list[Frf]] = {}
    for frf in frfs:
        uneven = frequency_axis(session, frf).tobytes() if frf.step_hz is None else None
        groups.setdefault((frf.quantity, frf.start_hz, frf.step_hz, frf.lines, uneven), []).append(
            frf
        )
    tables = []
    for rows in groups.values():
        frequency = frequency_axis(session, rows[0])
        lines = cut.lines(frequency)
        tables.append(FrfTable(session, rows, frequency[lines], lines))
    return tables


BY_QUERY = ("?quantity=", "?import_id=, ?point= or ?reference=")
BY_FILTER = (
    "?filter=, such as quantity = 'accelerance'",
    "?filter=, such as lines = 801 AND start_hz = 0",
)
"""How a request chooses FRFs of one quantity, and on one axis."""


def only_table(tables: Sequence[Written], choice: tuple[str, str] = BY_QUERY) -> Written:
    """The table of FRFs that make one.

    Args:
        tables: by quantity and axis.
        choice: how the request could choose one.

    Raises:
        Conflict: they are not on one frequency axis, or not of one quantity.
    """
    kinds = {table.quantity for table in tables}
    if len(kinds) > 1:
        raise Conflict(
            f"the FRFs are of several quantities ({', '.join(sorted(kinds))}); choose one with"
            f" {choice[0]}"
        )
    if len(tables) > 1:
        first, second = tables[0].frfs[0], tables[1].frfs[0]
        raise Conflict(
            f"the FRFs are on different frequency axes: {first.id} has {_axis(first)}, {second.id}"
            f" has {_axis(second)}; choose with {choice[1]}, read them one by one, or all as"
            " ?format=uff"
        )
    return tables[0]


def _axis(frf: Frf) -> str:
    return f"{frf.lines} lines from {frf.start_hz:g} to {frf.end_hz:g} Hz"


def _stream(session: Session, frfs: Sequence[Frf], *columns: str) -> Iterator[tuple[Any, ...]]:
    """The rows with these columns, in their order: the server reads the next spectrum while one is
    worked on.
    """
    query = (
        f"SELECT {', '.join(columns)} FROM unnest(%s::uuid[]) WITH ORDINALITY AS wanted (id, place)"
        " JOIN frfs USING (id) ORDER BY place"
    )
    rows = stream_rows(session, query, [[frf.id for frf in frfs]], ["bytea"] * len(columns))
    for frf, row in zip(frfs, rows, strict=True):
        yield frf, *row


@dataclass(frozen=True)
class MeasuredFrfs:
    """FRFs of one quantity on one frequency axis."""

    # in the specimen's frame; `variance` where every FRF has a coherence and a number of averages
    frfs: FrfSet
    ids: tuple[UUID, ...]  # N ids of their rows
    sha256s: tuple[str, ...]  # N digests of their spectra, hexadecimal
    # rates of the exponential windows that they state to carry, and their standard deviations, 1/s;
    # None of those that state nothing
    windows: frozenset[tuple[float | None, float | None]]

    @property
    def window(self) -> tuple[float | None, float | None]:
        """The rate that all of them state, and its standard deviation, 1/s; None where they state
        none, or different ones.
        """
        return next(iter(self.windows)) if len(self.windows) == 1 else (None, None)

    @property
    def window_remark(self) -> list[str]:
        """What the windows mean for modes that are found from these FRFs, in words."""
        rates = sorted(rate for rate, _ in self.windows if rate)
        if not rates:
            return []
        shown = ", ".join(f"{rate:g}" for rate in rates)
        return [
            f"FRFs carry an exponential window of {shown} per second: every decay rate ζω is seen"
            " too large by it, and so is the Rayleigh coefficient a0 by twice it"
        ]


@dataclass(frozen=True)
class MeasuredCampaign:
    """All that an update needs to know of a campaign."""

    campaign_id: UUID  # its key
    structure_version_id: UUID  # key of the structure's version that this was read with
    structure_version: int  # its number
    structure: StructureIn  # what the structure is in that version
    frame: Frame  # of the file's coordinates
    boundary: str  # cantilever, free or simply_supported
    sensor_mass_kg: float  # mass of the sensor, 0 where none is stated
    # grid point where the sensor sits; None where it roves or is not stated
    sensor_point: int | None
    added_masses: tuple[AddedMass, ...]  # what the specimen carried besides the sensor
    inputs: CampaignInputs  # how well is known what the test was done with
    temperature_c: float | None  # in the test, °C; None where nobody stated it
    points: dict[int, tuple[float, float, float]]  # label to coordinates in the specimen's frame, m
    frf_sets: tuple[MeasuredFrfs, ...]  # one per quantity and frequency axis, the largest first
    warnings: tuple[str, ...]  # FRFs that were left out, and why

    def without_frfs(self, none: str) -> str:
        """Why no FRF can be used: it has `none`, which says what to do, or none of those that it
        has states its place.
        """
        if not self.warnings:
            return none
        count = len(self.warnings)
        return (
            f"has {count} {'FRF' if count == 1 else 'FRFs'}, and none states point and direction of"
            " response and reference (0 in the file): state them in the file, delete its import,"
            " and import it again"
        )


def load_measured_campaign(session: Session, campaign_id: UUID) -> MeasuredCampaign:
    """Read a campaign with its spectra.

    Raises:
        InputError: the campaign's frame does not fit the directions of its FRFs.
    """
    campaign = campaign_of(session, campaign_id)
    version, structure = present_structure(session, campaign.structure_id)
    instruments = Instruments.model_validate(campaign.instruments)
    frame = frame_of(campaign)
    warnings: list[str] = []
    return MeasuredCampaign(
        campaign_id=campaign.id,
        structure_version_id=version.id,
        structure_version=version.number,
        structure=structure,
        frame=frame,
        boundary=campaign.boundary,
        sensor_mass_kg=instruments.sensor_mass_kg or 0.0,
        sensor_point=instruments.sensor_point,
        added_masses=tuple(instruments.added_masses),
        inputs=CampaignInputs.model_validate(campaign.inputs or {}),
        temperature_c=campaign.temperature_c,
        points=specimen_points(session, campaign),
        frf_sets=tuple(_frf_sets(session, campaign, frame, warnings)),
        warnings=tuple(warnings),
    )


def specimen_points(session: Session, campaign: Campaign) -> dict[int, tuple[float, float, float]]:
    """Label to coordinates in the specimen's frame, m."""
    stored = stored_points(session, campaign.id)
    if not stored:
        return {}
    moved = frame_of(campaign).points(np.array(list(stored.values())))
    return {
        label: (float(x), float(y), float(z))
        for label, (x, y, z) in zip(stored, moved, strict=True)
    }


def _frf_sets(
    session: Session, campaign: Campaign, frame: Frame, warnings: list[str]
) -> list[MeasuredFrfs]:
    usable = []
    for row in frf_for.all(session, campaign_id=[campaign.id]):
        if 0 in (
            row.response_point,
            row.response_direction,
            row.reference_point,
            row.reference_direction,
        ):
            warnings.append(
                f"FRF {row.id} ({row.label}) states no point or direction and is left out"
            )
        else:
            usable.append(row)
    sets = [_measured(table, frame) for table in make_tables(session, usable, Cut())]
    return sorted(sets, key=lambda s: -s.frfs.values.size)


def _measured(table: FrfTable, frame: Frame) -> MeasuredFrfs:
    rows = list(table.frfs)
    values = np.array([spectrum for _, spectrum in table.spectra()], dtype=np.complex128)
    frfs = FrfSet(
        frequency_hz=table.frequency_hz,
        values=values,
        responses=tuple(frame.dof(Dof(row.response_point, row.response_direction)) for row in rows),
        references=tuple(
            frame.dof(Dof(row.reference_point, row.reference_direction)) for row in rows
        ),
        quantity=rows[0].quantity,  # type: ignore[arg-type]  # the column holds what was checked on the way in
        variance=_variance(table, values),
        growth=table.of_hits("growth"),
    )
    return MeasuredFrfs(
        frfs=frfs,
        ids=tuple(row.id for row in rows),
        sha256s=tuple(row.sha256.hex() for row in rows),
        windows=frozenset((row.window_rate_per_s, row.window_rate_sd_per_s) for row in rows),
    )


def _variance(table: FrfTable, values: np.ndarray) -> FloatArray | None:
    """E|n|² = |H|² (1 - γ²) / (γ² n_d) of an H1 estimate from n_d averages (Bendat & Piersol,
    Random Data, 9.2.4).

    FRFs made of time blocks carry the variance that the scatter of their hits showed, and it is
    used instead. NaN where the noise is not known: FRFs without a coherence or with fewer than two
    averages, lines that are zero or whose coherence is not strictly between 0 and 1, as analysers
    write it where rounding or a silent channel made it.

    None where nothing is known.
    """
    if (of_hits := table.of_hits("variance")) is not None:
        return of_hits.real
    variance = np.full(values.shape, np.nan)
    for i, (row, gamma) in enumerate(table.coherences()):
        averages = row.averages or 0
        if gamma is not None and averages > 1:
            known = (gamma > 0) & (gamma < 1) & (values[i] != 0)
            variance[i, known] = (
                np.abs(values[i, known]) ** 2 * (1 - gamma[known]) / (gamma[known] * averages)
            )
    return None if np.isnan(variance).all() else variance
