"""Campaigns: measurements of a structure, what is imported, made and found of them."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from modalbase.client.errors import ClientError, Exit
from modalbase.client.rest import require_known
from modalbase.formats.registry import FRF_SUFFIXES
from modalbase.objects.finding import CAMPAIGN, Kind
from modalbase.objects.jobs import (
    Identification,
    Import,
    ModeSet,
    Processing,
    UpdateJob,
    update_jobs,
)
from modalbase.objects.thing import Attached, Editable, Figure, Table, Thing

if TYPE_CHECKING:
    from modalbase.formats.records import Place
    from modalbase.objects.frfs import Frfs


class Record(Thing):
    """One time block: the force or a response of one hit."""

    noun = Kind("record", "records/{}", "campaigns/{}/records")

    def samples(self) -> tuple[Any, Any]:
        """(T,) times in s and (T,) samples in SI, as numpy arrays."""
        import numpy as np

        content = self.lab.rest.get_record_data(self.fields["id"], format="npz")
        with np.load(BytesIO(content)) as arrays:
            return arrays["time_s"], arrays["samples"]

    def sep005(self) -> dict[str, Any]:
        """The block as a time series of SDyPy's SEP 5, with its place and hit in fields of their
        own.
        """
        from modalbase.formats.records.arrays import TimeBlock
        from modalbase.formats.records.sep005 import records_to_sep005

        known = {
            name: self.fields[name] for name in TimeBlock.__dataclass_fields__ if name != "samples"
        }
        return records_to_sep005([TimeBlock(**known, samples=self.samples()[1])])[0]

    def delete(self) -> None:
        """Delete it for good."""
        self.lab.rest.delete_record(self.fields["id"])


class Recording(Thing):
    """A recording of responses to loads that nobody measured."""

    noun = Kind("recording", "recordings/{}", "campaigns/{}/recordings")

    def spectra(self) -> dict[str, Any]:
        """Its spectra as numpy arrays: `frequency_hz` (L,), power spectra `auto` (N, L) and `cross`
        (N, R, L) of N sensors with R references, `half` spectra of the blocks, `responses` and
        `references` as rows of point and direction.

        Raises:
            ClientError: no processing has made them yet.
        """
        import numpy as np

        content = self.lab.rest.get_recording_spectra(self.fields["id"], format="npz")
        with np.load(BytesIO(content)) as arrays:
            return dict(arrays)

    def deflection(self, frequency_hz: float | None = None) -> dict[str, Any]:
        """Its operating deflection shape at a line, the strongest by default: `frequency_hz` of the line, `reference`, `unit`
        and `shape`, `point`, `direction`, `real` and `imag` of each sensor.

        Raises:
            ClientError: no processing has made its spectra yet.
        """
        shape: dict[str, Any] = self.lab.rest.get_recording_deflection(
            self.fields["id"], frequency_hz=frequency_hz
        )
        return shape

    def transmissibility(self, *references: tuple[int, int]) -> dict[str, Any]:
        """What its sensors do for each unit of one or several of them, as numpy arrays:
        `frequency_hz` (L,), `values` and `variance` (N, R, L), multiple `coherence` (N, L),
        `responses` and `references` as rows of point and direction, and `warnings`, such as which
        lines are left out.

        Args:
            references: point and direction of sensors among the references of the processing;
                its first one where none is stated.

        Raises:
            ClientError: no processing has made its spectra yet, or references are alike.
        """
        import numpy as np

        content = self.lab.rest.get_recording_transmissibility(
            self.fields["id"], references=_named(references), format="npz"
        )
        with np.load(BytesIO(content)) as arrays:
            return dict(arrays)

    def save_transmissibility(self, file: str | Path, *references: tuple[int, int]) -> Path:
        """Write the same to a file: `.uff` (sets 58 of type 5), `.npz`, `.h5`, `.parquet` or `.json`.

        Raises:
            ClientError: the name says no format, or as of `transmissibility`.
        """
        return self._save("transmissibility", file, SPECTRA, references=_named(references))

    def save_spectra(self, file: str | Path) -> Path:
        """Write its spectra to a file: `.uff`, `.npz`, `.h5`, `.parquet` or `.json`.

        Raises:
            ClientError: the name says no format, or no processing has made them yet.
        """
        return self._save("spectra", file, SPECTRA)


SPECTRA = {".uff": "uff", ".npz": "npz", ".h5": "hdf5", ".parquet": "parquet", ".json": "json"}
"""Formats of spectra of a recording, by the end of a file's name."""
POINT = ("label", "x_m", "y_m", "z_m")


class Campaign(Attached, Editable):
    """Measurements of a structure under one boundary condition."""

    noun = CAMPAIGN

    def import_file(self, file: str | Path, *, wait: bool = True, **options: Any) -> Import:
        """Send a file of measured data and wait until it is read.

        Args:
            file: the analyser's export; its format is recognised by its content.
            wait: for the end of the reading.
            options: `mapping` of hits, of responses, and of FRFs of a .mat, which variable is what;
                `kind` of an npz, .mat or CSV, `hits` or `frfs`, where its arrays do not say, and of
                any file `responses`, where no load was measured; `quantity` of FRFs
                whose file does not say (`accelerance`, `mobility`, `receptance`); `dry_run`.

        Returns:
            The import: `counts`, `datasets` with what became of each, `found` with the arrays and a
            mapping that suggests itself, `warnings`.

        Raises:
            JobFailed: the file could not be read.
            ClientError: the service refuses it.
        """
        require_known("start_import", options)
        if "dry_run" in options:
            options["dry_run"] = bool(options["dry_run"])
        sent = Import(
            self.lab,
            self._send("imports", file, **options),
        )
        return sent.wait().check() if wait else sent

    def imports(self) -> list[Import]:
        """The files that were sent."""
        return self._list(Import)

    def grid_points(self) -> Table:
        """Its grid points: `label`, `x_m`, `y_m`, `z_m`."""
        return Table(self._get("grid-points")["items"], key="label")

    def set_grid_points(self, points: Iterable[Mapping[str, Any] | Sequence[float]]) -> Table:
        """State the grid points, in place of those that are there; returns them as stored.

        Args:
            points: each as `{"label": 1, "x_m": 0.1, "y_m": 0, "z_m": 0}` or as `(1, 0.1, 0, 0)`.

        Raises:
            ClientError: the service refuses them, or somebody else states others at this moment.
        """
        items = [
            dict(p) if isinstance(p, Mapping) else dict(zip(POINT, p, strict=True)) for p in points
        ]
        stored = self._call("PUT", "grid-points", json={"items": items}, replaced=True)
        return Table(stored["items"], key="label")

    def save_grid_points(self, file: str | Path, file_format: str | None = None) -> Path:
        """Write its grid points to a file in the format that is stated or that its name says:
        `.csv` or `.json`; `-` is standard output.

        Raises:
            ClientError: the name says no format, or the service has no grid points in it.
        """
        return self._save("grid-points", file, FRF_SUFFIXES, format=file_format)

    def alignment(self) -> Table:
        """How its points lie on the structure: distance, set and normal of each, and whether an
        update refuses it.
        """
        return Table(self.lab.rest.get_alignment(self.fields["id"])["items"], key="label")

    def align(self, pairs: Mapping[int, Sequence[float]] | None = None) -> dict[str, Any]:
        """Find the frame that brings its points onto the structure, and take it.

        Args:
            pairs: of three grid points or more where they are on the structure, m:
                `{1: (0.0, 0.02, 0.06), …}`; by default the closest points are found.

        Returns:
            What was found: `frames`, the best first, and a `sentence`.

        Raises:
            ClientError: several frames fit about as well, so pairs are needed; or the service
                refuses.
        """
        named = (
            None
            if pairs is None
            else [dict(zip(POINT, (n, *at), strict=True)) for n, at in pairs.items()]
        )
        alignment: dict[str, Any] = self.lab.rest.find_alignment(
            self.fields["id"], body={"pairs": named}
        )
        if len(alignment["frames"]) > 1:
            raise ClientError(alignment["sentence"], Exit.USAGE)
        self.change(frame=alignment["frames"][0]["frame"])
        return alignment

    def list_frfs(self, most: int | None = None, **filters: Any) -> Table:
        """What its FRFs are, without their spectra.

        Args:
            most: how many at most; None for all.
            filters: `point`, `direction`, `reference`, `quantity`, `import_id`, `fmin`, `fmax`.

        Raises:
            ClientError: there is no such filter.
        """
        require_known("list_frfs", filters)
        return Table(self._pages("frfs", most, **filters), key="label")

    def frfs(self, **filters: Any) -> Frfs:
        """Its FRFs with their spectra, as numpy arrays. They must have one axis and one quantity.

        Args:
            filters: as for `list_frfs`, and `stride`.

        Raises:
            ClientError: none matches, they have several axes or quantities, or there is no such
                filter.
        """
        from modalbase.objects.frfs import Frfs

        return Frfs.from_npz(self._call("GET", "frfs/data", params=_npz(filters)))

    def figure(self, name: str, **options: Any) -> Figure:
        """A figure, shown in a notebook: `frf`, `hits` or `spectra`.

        Args:
            name: which one.
            options: `point`, `direction`; of `frf` also `reference`, `fmin`, `fmax`; of `hits` also
                `response`.

        Raises:
            ClientError: there is no such option.
        """
        require_known("get_campaign_figure", options)
        return Figure(self.lab, self._at(f"figures/{name}"), options)

    def archive(self, file: str | Path) -> Path:
        """Write it, with its structure and instruments, to a zip that others read without this
        service.
        """
        return self._save("archive", file)

    def label_frfs(
        self, *, tags: Sequence[str] = (), meta: Mapping[str, Any] | None = None, **which: Any
    ) -> int:
        """Give a set of FRFs tags and metadata in place of theirs, by which a search finds them;
        the number of FRFs.

        Args:
            tags: words without commas.
            meta: free JSON, such as `{"client": "ACME"}`.
            which: as for `list_frfs`; all where nothing is stated.

        Raises:
            ClientError: the service refuses, for example since the project demands other metadata.
        """
        require_known("label_frfs", which)
        body = {"tags": list(tags), "meta": dict(meta or {})}
        return int(self._call("PUT", "frfs/labels", params=which, json=body)["count"])

    def add_frfs(self, frfs: Frfs) -> Table:
        """Store FRFs that a script has; `modalbase.Frfs` takes arrays, pyuff datasets and xarray.

        Raises:
            ClientError: the service refuses them.
        """
        answer = self.lab.rest.create_frfs(
            self.fields["id"], content=frfs.to_npz(), content_type="application/x-npz"
        )
        if "items" in answer:
            return Table(answer["items"], key="label")
        return self.list_frfs(import_id=Import(self.lab, answer).wait().check().fields["id"])

    def add_records(
        self, file: str | Path, mapping: Mapping[str, Any] | None = None
    ) -> dict[str, Any]:
        """Send a file of time blocks of hits.

        Args:
            file: what the analyser wrote.
            mapping: which variable is what; `propose_mapping` makes one.

        Returns:
            `items`, the stored blocks, and `hits`, the judgement of each hit.
        """
        return self._judged(self._send("records", file, mapping=mapping))

    def add_sep005(
        self,
        series: Mapping[str, Any] | Sequence[Mapping[str, Any]],
        places: Mapping[str, Place | int],
        *,
        hit: int | None = None,
        sensitivities: Mapping[str, float] | None = None,
    ) -> dict[str, Any]:
        """Send time series of SDyPy's SEP 5 as time blocks of hits.

        Args:
            series: a dict with `data`, `fs` or `time`, `name` and `unit_str`, or a list of them;
                one measures a force.
            places: grid point of each channel by its name, or a `Place` with its direction.
            hit: number of the first hit; None counts on from those that the point has.
            sensitivities: volts per SI unit of channels in V, by name.

        Returns:
            `items`, the stored blocks, and `hits`, the judgement of each hit.

        Raises:
            FormatError: the series are not what SEP 5 says, or unlike one another.
            ClientError: the service refuses them.
        """
        from modalbase.formats.records.arrays import arrays_of
        from modalbase.formats.records.sep005 import records_from_sep005

        blocks = records_from_sep005(series, places, hit=hit, sensitivities=sensitivities)
        content, mapping = arrays_of(blocks, numbered=hit is not None)
        answer = self.lab.rest.create_records(
            self.fields["id"],
            filename="sep005.npz",
            mapping=json.dumps(mapping),
            content=content,
            content_type="application/x-npz",
        )
        return self._judged(answer)

    def propose_mapping(self, file: str | Path, kind: str = "hits") -> dict[str, Any]:
        """What a file of time blocks holds, and a mapping in its own words; None where it says
        nothing. Nothing is stored.

        Args:
            file: what the recorder wrote.
            kind: `hits`, or `responses` where no load was measured.
        """
        proposal: dict[str, Any] = self.import_file(file, kind=kind, dry_run=True).fields["found"]
        return proposal

    def _judged(self, answer: dict[str, Any]) -> dict[str, Any]:
        """Stored blocks and the judgement of their hits; waits for a file that was not read at
        once.
        """
        if "items" in answer:
            return answer
        return Import(self.lab, answer).wait().check().records()

    def records(self, **filters: Any) -> list[Record]:
        """Its time blocks, without their samples.

        Args:
            filters: `point` that was hit, `hit`.

        Raises:
            ClientError: there is no such filter.
        """
        require_known("list_records", filters)
        return self._list(Record, **filters)

    def recordings(self) -> list[Recording]:
        """Its recordings of responses to loads that nobody measured."""
        return self._list(Recording)

    def judge(
        self, hit: Record | Mapping[str, Any] | tuple[int, int], *, good: bool | None, why: str
    ) -> dict[str, Any]:
        """Accept or refuse a hit by hand, whatever its probability; every later processing keeps to
        it.

        Args:
            hit: one of its time blocks, a judgement with `point`, `direction` and `hit`, or (point,
                number of the hit).
            good: whether it is used; None takes earlier decisions back.
            why: for those who read the FRFs.

        Returns:
            The decision as it is kept, with `by` and `created_at`.

        Raises:
            ClientError: the campaign has no such hit.
        """
        if isinstance(hit, Record):
            named = {name: hit.fields[f"force_{name}"] for name in ("point", "direction")} | {
                "hit": hit.fields["hit"]
            }
        elif isinstance(hit, Mapping):
            named = {name: hit[name] for name in ("point", "direction", "hit") if name in hit}
        else:
            named = dict(zip(("point", "hit"), hit, strict=True))
        decision: dict[str, Any] = self.lab.rest.judge_hit(
            self.fields["id"], body={**named, "good": good, "why": why}
        )
        return decision

    def hit_decisions(self) -> list[dict[str, Any]]:
        """What was decided of its hits by hand, newest first: `good`, `why`, `by` and `created_at`
        of each.
        """
        return self._pages("hit-decisions")

    def process(self, *, wait: bool = True, **options: Any) -> Processing:
        """Make FRFs of the good hits, and half spectra of recordings of responses.

        Args:
            wait: for its end.
            options: of hits `estimator`, `windows`, `band_hz`, `delay_s`, `false_discovery`,
                `overrules`; of recordings `references`, `lag_s`.

        Raises:
            JobFailed: it did not succeed.
        """
        job = self._make(Processing, options)
        return job.wait().check() if wait else job

    def new_mode_set(
        self, name: str, modes: Sequence[Mapping[str, Any]], excitation: str = "measured"
    ) -> ModeSet:
        """Type in modes that were found elsewhere.

        Args:
            name: of the set.
            modes: each with `frequency_hz`, and where known `damping_ratio`, `frequency_sd_hz`,
                `damping_sd`, `shape`.
            excitation: `unmeasured` where they were found in responses alone, so that shapes are
                unscaled.
        """
        body = {"name": name, "modes": [dict(mode) for mode in modes], "excitation": excitation}
        return self._make(ModeSet, body)

    def mode_sets(self) -> list[ModeSet]:
        """Its mode sets: typed in, of a file, identified."""
        return self._list(ModeSet)

    def mode_set(self, which: str = "latest", *, create: bool = False, **fields: Any) -> ModeSet:
        """One of its mode sets by id, name or `latest`; with `create` made of `modes` where there
        is none of this name.
        """
        if "modes" in fields:  # the service has them in this order
            fields["modes"] = sorted(
                fields["modes"], key=lambda mode: float(mode.get("frequency_hz", 0))
            )
        return self._one(ModeSet, which, create, fields)

    def identify(self, **options: Any) -> ModeSet:
        """Find modes in its FRFs and wait for them.

        Args:
            options: `band_hz`, `highest_order`, `most_modes`, `threshold`, `include_doubtful`,
                `poles`, `name`.

        Raises:
            JobFailed: no mode was found; the text says why.
        """
        job = self._make(Identification, options)
        return job.wait().mode_set()

    def update(
        self,
        recipe: Mapping[str, Any] | None = None,
        *,
        confirm: bool = False,
        idempotency_key: str | None = None,
        **more: Any,
    ) -> UpdateJob:
        """Queue an update of the structure's model to this campaign; the job's `wait()` or
        `result()` waits for it.

        Args:
            recipe: the recipe as a dictionary; without it the defaults.
            confirm: take unusual numbers of its priors as they are.
            idempotency_key: of printable ASCII; the same key again gives the same job, no second
                one.
            more: fields of the recipe by name, such as `seed=7` or `mode_set=modes`. Things stand
                for their ids.

        Raises:
            ClientError: the service refuses the recipe; each fault has its pointer.
        """
        body = {
            name: value.fields["id"] if isinstance(value, Thing) else value
            for name, value in more.items()
        }
        whole = {**(recipe or {}), **body}
        headers = None if idempotency_key is None else {"Idempotency-Key": idempotency_key}
        return self._make(UpdateJob, whole, confirm, headers)

    def jobs(self) -> list[UpdateJob]:
        """Its update jobs, newest first."""
        return update_jobs(self.lab, campaign=self.fields["id"])

    def complete(self) -> list[dict[str, Any]]:
        """Say that it is complete: monitors of the structure run on it. Returns their runs."""
        runs: list[dict[str, Any]] = self.lab.rest.complete_campaign(self.fields["id"])["runs"]
        return runs

    def export(self, file: str | Path, file_format: str | None = None, **filters: Any) -> Path:
        """Write its FRFs to a file: `.uff`, `.npz`, `.h5`, `.csv`, `.json`, `.arrow` or `.parquet`, as its name says;
        `-` is standard output.

        Raises:
            ClientError: the name says none of these, nothing matches, or there is no such filter.
        """
        require_known("get_campaign_data", filters)
        return self._save("frfs/data", file, FRF_SUFFIXES, format=file_format, **filters)


def _named(sensors: Sequence[tuple[int, int]]) -> list[str]:
    """Sensors as an address names them."""
    return [f"{point}:{direction}" for point, direction in sensors]


def _npz(filters: Mapping[str, Any]) -> dict[str, Any]:
    if "format" in filters:
        raise ClientError("frfs() has arrays; export() writes a file in a format")
    require_known("get_campaign_data", filters)
    return {**filters, "format": "npz"}
