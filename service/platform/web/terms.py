"""What a name means in the contract, with its unit: the same wherever it stands, unless a schema
says more.

The OpenAPI document describes every property and every id in a path. What a schema does not
describe itself has its sentence here, by the name of the property, or of schema and property where
one name has two meanings.
"""

from collections.abc import Mapping

TERMS: dict[str, str] = {
    # who and when
    "id": "UUIDv7; sorts by the time of creation",
    "created_at": "when it was made, UTC",
    "updated_at": "when it was last changed, UTC",
    "deleted_at": "when it was deleted, UTC; null where it was not. It can be restored",
    "archived_at": "when it was archived, UTC; null where it was not",
    "started_at": "when the last attempt began, UTC; null while it waits",
    "finished_at": "when it ended, UTC; null until then",
    "at": "when, UTC",
    "by": "name of the user; null where it was the service itself",
    "user": "name of the user",
    "name": "what people call it",
    "description": "in words, for people",
    "note": "in words, for people",
    "notes": "in words, for people",
    "tags": "words to find it by",
    "meta": "free JSON to find it by",
    "schemas": "JSON Schema that tags and metadata must fulfil, by noun",
    "search_id": "id of the saved search",
    "noun": "what is searched for",
    "filter": "conditions in CQL2 text",
    "q": "words that must occur",
    "sort": "fields to sort by; with a minus, downwards",
    "fields": "columns of the answer",
    "items": "the rows of this page",
    "next_cursor": "hand it in as `cursor` to get the next page; null on the last one",
    "request_id": "name of the request in the service's log",
    # ids
    **{f"{thing}_name": f"name of the {thing}" for thing in ("structure", "campaign", "monitor")},
    "structure_version_id": "id of the structure's version that is used, which never changes",
    "batch_id": "id of the coupon batch",
    "coupon_id": "id of the specimen",
    "DampingModelFit.name": "as the recipe names it",
    "DampingModelFit.coefficients": "by name, SI",
    "DampingModelFit.standard_deviations": "of the coefficients, by name, SI",
    "DampingModelFit.bic": "Bayesian information criterion; the least is preferred",
    "DampingModelFit.preferred": "whether it has the least of all",
    "CurveForm.coupon": "what is known of the specimen, and how its curve is read",
    "update_job_id": "id of the update job; null before there is one",
    "job_id": "id of the update job",
    "record_id": "id of the time block",
    "frf_id": "id of the FRF",
    "subject_id": "id of the thing; null where the act has none",
    "project": "id of the project",
    # projects, keys, audit
    "archived": "whether the project is archived: readable, and refused every change",
    "role": "viewers read, editors also write and start jobs, owners also manage members",
    "member": "name or id of the user",
    "prefix": "first characters of the key, by which it is recognised",
    "key": "the key itself; shown this once",
    "scopes": "what the key may be used for",
    "last_used_at": "when the key was last used, UTC, to the minute",
    "expires_at": "when it ends by itself, UTC; null: never",
    "revoked_at": "when it was revoked, UTC; null where it was not",
    "action": "what was done, as `thing.verb`",
    "subject_type": "kind of thing that it was done to",
    "detail": "values worth keeping of the act, by name",
    # structures
    "geometry": "length, width and thickness of a strip or plate, m",
    "density_kg_m3": "mass density, kg/m³",
    "laminate": "plies from the bottom to the top; instead of a material",
    "material": "homogenised constants in the specimen's axes, Pa; instead of a laminate",
    "plies": "from the bottom (z = −t/2) to the top",
    "nu_xy": "Poisson's ratio of contraction along y under tension along x, without unit",
    "nu_12": "Poisson's ratio of contraction along 2 under tension along 1, without unit",
    "angle_deg": "from x to the fibre, towards y, degrees",
    # campaigns
    "boundary": (
        "how the specimen is held; a cantilever is clamped at x = 0; as_modelled: by the deck's"
        " supports"
    ),
    "performed_at": "when the test was performed, UTC; null where nobody knows",
    "TrendLine.relative_interval_95": "of the change a year, as a share of the mean",
    "serial": "its serial number",
    "model": "what the maker calls it",
    "calibrations": "its history, oldest first",
    "performed_on": "day of the calibration",
    "InstrumentIn.kind": "what it is",
    "InstrumentOut.kind": "what it is",
    "instruments": "what was measured with: hammer, sensor, analyser",
    "frame": "where the specimen lies in the file's coordinates; default: both are the same",
    "origin_m": "origin of the specimen's frame in the file's coordinates, m",
    "x_axis": "unit vector along the specimen, in the file's coordinates",
    "y_axis": "unit vector across the specimen, in the file's coordinates",
    # files of a campaign
    "filename": "what the client called the file",
    "size": "of the file, bytes",
    "sha256": "SHA-256 of the bytes, hexadecimal",
    "dry_run": "whether the file was only looked at, and nothing was stored",
    "quantity": (
        "what was measured: accelerance, mobility, receptance; of a time block force, acceleration"
        " and so on"
    ),
    "datasets": "what became of each dataset of the file, in its order",
    "outcome": (
        "whether the dataset was read, ignored as a kind that is not needed, or refused as damaged"
    ),
    "reason": "why, in words; null where there is nothing to explain",
    "frfs": "how many FRFs",
    "grid_points": "how many grid points",
    "modes": "the modes",
    "Counts.modes": "how many modes",
    "MonitorOut.modes": "where runs take their modes from: `identify` or `given`",
    # FRFs and time blocks
    "label": "what the file or the script calls it",
    "response_point": "grid point of the response",
    "response_direction": (
        "of the response: ±1 … ±3 along x, y, z, ±4 … ±6 about them; 0 where the file does not say"
    ),
    "reference_point": "grid point of the force",
    "reference_direction": (
        "of the force: ±1 … ±3 along x, y, z, ±4 … ±6 about them; 0 where the file does not say"
    ),
    "unit": "SI unit of the values",
    "Dimensions.unit": "unit of width and thickness",
    "averages": "how many hits or blocks were averaged; null where nobody says",
    "lines": "number of frequency lines",
    "start_hz": "first frequency line, Hz",
    "end_hz": "last frequency line, Hz",
    "has_coherence": "whether a coherence is stored with it",
    "dtype": "precision of the stored values",
    "point": "label of the grid point",
    "direction": "±1 … ±3 along x, y, z, ±4 … ±6 about them",
    "force_point": "grid point that was hit",
    "force_direction": "of the force: ±1 … ±3 along x, y, z",
    "hit": "number of the hit at its point, from 1",
    "sample_rate_hz": "samples a second, Hz",
    "samples": "number of samples",
    "sensitivity": "factor that made the file's values SI",
    "window_rate_per_s": "rate 1/τ of an exponential window that the data carry, 1/s; 0: none",
    "full_scale": "largest value that the channel can show, in its SI unit; null where nobody says",
    "start_sample": (
        "first sample of the block in the recording that it was cut from, from 0; null: recorded"
        " alone"
    ),
    "accepted": "whether the hit is used",
    "findings": "what each criterion says of the hit",
    "criterion": "name of the criterion",
    "failed": "whether the number is beyond the limit",
    "sentence": "the same in words",
    "use": "whether the hit is to be used, whatever the criteria say",
    "why": "what a person decided it for",
    "estimator": "of the FRFs: H1 (noise on the response), H2 (noise on the force), Hv (on both)",
    "overrules": "hits that are used or left out against the criteria",
    "band_hz": "first and last frequency line, Hz",
    # modes
    "frequency_hz": "undamped natural frequency, Hz",
    "frequency_sd_hz": "standard deviation of the frequency, Hz; null where nobody knows",
    "damping_ratio": "viscous damping ratio ζ, not per cent",
    "damping_sd": "standard deviation of the damping ratio, not per cent; null where nobody knows",
    "shape": "displacements at the grid points, arbitrarily scaled; null where none were measured",
    "real": "real part, arbitrarily scaled",
    "imag": "imaginary part, arbitrarily scaled",
    "origin": "typed in, from a file, or identified by a job",
    # jobs
    "status": "how far the job is: queued, running, succeeded, failed, cancelled",
    "stage": "what the job does at the moment; null before it begins",
    "attempt": "how often it was begun: more than 1 where a worker was lost",
    "message": "in words what happened; null where there is nothing to say",
    "error": "kind, exception and detail of a failure; null where it did not fail",
    "priority": "of the project's waiting jobs the highest runs first; −100 to 100",
    "warnings": "in words; read them first",
    # recipes
    "prior_mean": "mean of the prior, SI; default: the structure's nominal value",
    "prior_sd": "standard deviation of the prior, SI; default: 30 % of the mean",
    "fixed": "whether the parameter keeps its prior mean",
    "edge": "edge of the specimen that the spring holds; null for a spring at a point",
    "weighting": (
        "of the FRFs' lines in the damping update: by their noise, relative, logarithmic, or none"
        " (linear)"
    ),
    "seed": "of the random numbers; the same seed gives the same result",
    "length_sd_m": "of the length, m",
    "width_sd_m": "of the width, m",
    "height_sd_m": "of the height of a body in space, m",
    "thickness_sd_m": "of the thickness, m",
    "density_sd_kg_m3": "of the density, kg/m³",
    "nu_xy_sd": "of Poisson's ratio, without unit",
    "inputs": (
        "how well what was handed in is known: standard deviations, SI; default: a careful"
        " laboratory's"
    ),
    "campaigns": "the campaigns, in the order in which they were named",
    "joint": "the joint update; null where the jobs are separate",
    "joint_id": "id of the joint update",
    "mass_kg": "mass, kg",
    "mode_set": "id of the mode set",
    "tests": "the candidate tests",
    "shrinks_most": "what the test would make most certain",
    "added_masses": "masses that are fixed to the specimen for the test",
    "sensor_mass_kg": "mass of the sensor, kg",
    "pieces": "steps and tapers of thickness along x",
    "line_spacing_hz": "distance of the frequency lines, Hz",
    "jobs": "the updates, in the order of the answer",
    # coupons
    "specimen": "what the laboratory calls the specimen",
    "standard": "by which it was tested: ASTM D3039 (tension) or D3518 (shear of ±45°)",
    "E_Pa": "tensile chord modulus, Pa",
    "G_Pa": "in-plane shear chord modulus, Pa",
    "nu": "Poisson's ratio, without unit",
    "strength_Pa": "largest stress, Pa",
    "ultimate_strain": "strain at failure, m/m",
    "failure_code": "of D3039, three parts: type, area, location",
    "excluded": "whether the specimen does not count",
    "Summary.excluded": "specimens that do not count, and why",
    "exclusion_reason": "why the specimen does not count; null where it does",
    "constants": "elastic constants that the batch gives",
    "published": (
        "means that are known without their specimens, by constant; Pa, a Poisson's ratio has no"
        " unit"
    ),
    "conditions": "conditioning, speed, machine, gauge and grips, in words, by name",
    "mean": "mean, in its unit",
    "standard_deviation": "standard deviation, in its unit",
    "source": "whether it comes from specimens here or was published",
    "encoding": "character set of the file",
    "delimiter": "between the file's columns",
    "decimal": "the file's decimal point or comma",
    "run": "number of the run in the file, from 1",
    "runs": "number of runs in the file",
    "first_line": "first line of the run's values in the file",
    "last_line": "last line of the run's values in the file",
    "points": "number of points of the curve",
    "CouponCurveOut.series": "columns of the curve",
    "width": "measured widths, in `unit`",
    "thickness": "measured thicknesses, in `unit`",
    # monitoring
    "active": "whether the monitor runs and judges by itself",
    "recipe": "with which every campaign is updated",
    "priors": "where runs take their priors from: `baseline` or `last`",
    "parameters": "what is watched, and where it must not go",
    "parameter": "name of the watched parameter",
    "covariates": "measured beside the parameters, whose influence is taken out",
    "false_alarm_rate": "false alarms a campaign, of all parameters together",
    "horizon": "campaigns after the baseline over which that rate is held",
    "pending": "consecutive campaigns outside that make an alarm",
    "expected_interval_days": (
        "days between campaigns; a later one is `no data`; null: nothing is expected"
    ),
    "runs_on": "when campaigns are run: `campaign`, `schedule` or `hand`",
    "schedule": "five cron fields, UTC; null without a schedule",
    "next_run_at": "when the schedule runs next, UTC; null without a schedule",
    "state": "where it stands",
    "state_since": "since when, UTC",
    "open_alarms": "number of alarms that nobody has acknowledged and that have not cleared",
    "ChartIn.kind": "EWMA and CUSUM for small lasting changes, Shewhart for single large ones",
    "series": "version of the series, from 1",
    "software": "version of modalbase that computed it",
    "acknowledged_at": "when somebody said to have seen it, UTC",
    "acknowledged_by": "name of who did",
    "history": "every step of the alarm, oldest first",
    "event": "what happened",
    "events": "what the webhook is called for",
    "completed_at": "when somebody said that all of the campaign is in, UTC",
    # webhooks
    "url": "where messages go",
    "secret": "with which every message is signed; shown this once",
    "body": "what was or will be sent",
    "attempts": "how often it was tried",
    "last_status": "HTTP status of the last answer; null where there was none",
    "last_error": "why the last attempt failed; null where it did not",
    "delivered_at": "when it arrived, UTC; null until then",
    "dimensions": "measured width and thickness of the specimen, with their unit",
    "file": "the file, and how it was read",
    "request": "as it was sent",
    "options": "as they were sent, with defaults",
    "baseline": "campaigns that later ones are held against",
    "chart": "the control chart",
    "identification": "how modes are identified where none are given",
    "hold_out": "what the fits do not see, to check the result against",
    "number": "of the version, from 1",
    "format": "of the answer",
}
"""Sentences by name, or by `Schema.name`; of an id that has none `term` makes it."""


def term(name: str, schema: str = "") -> str | None:
    """The sentence of a member or parameter, one of its schema's own before that of its name; None
    where there is none.
    """
    thing = name.removesuffix("_id")
    made = None if thing == name else f"id of the {thing.replace('_', ' ')}"
    return TERMS.get(f"{schema}.{name}", TERMS.get(name, made))


OPEN: dict[str, object] = {
    "hammer": {"model": "8206-002"},
    "sensor": {"model": "4507"},
    "analyser": {"model": "3160"},
    "published": {"Ex": {"mean": 33.1e9, "standard_deviation": 0.5e9, "n": 5}},
    "conditions": {"speed": "2 mm/min"},
    "columns": {"force": {"column": "Load", "unit": "kN"}},
}
"""Examples of objects whose members the client names; those without one are shown empty."""

TAGS: list[tuple[str, str]] = [
    (
        "projects",
        "A project holds everything that people share. **The main job begins here**: make one.",
    ),
    (
        "structures",
        "What is tested: geometry, density, and a laminate or a material with nominal values.",
    ),
    (
        "campaigns",
        "One test of a structure: how it was held, when, with which instruments; its grid points.",
    ),
    ("grid points", "Where was measured: labels and coordinates, as JSON or CSV."),
    (
        "models",
        "Decks of Abaqus, CalculiX and Nastran, or matrices of any solver, into a structure.",
    ),
    ("imports", "UFF files into a campaign: send one, then ask until it has succeeded."),
    ("FRFs", "What was measured: lists, spectra in six formats, and FRFs from scripts."),
    (
        "recordings",
        "Responses to loads that nobody measured, such as wind: modes are found without a force.",
    ),
    ("records", "Time blocks of hammer tests: send hits, see which are good, make FRFs of them."),
    (
        "identifications",
        "Modes from FRFs, by a job. An update without a mode set does this by itself.",
    ),
    (
        "mode sets",
        "Natural frequencies, damping ratios and shapes: typed in, from a file, or identified.",
    ),
    ("coupons", "ASTM D3039 and D3518 specimens, whose statistics are priors of an update."),
    (
        "update jobs",
        (
            "The model updated to a campaign: start with `{}`, ask until it has succeeded, read the"
            " result."
        ),
    ),
    ("monitoring", "The same recipe as a structure ages: series, limits, alarms."),
    (
        "search",
        (
            "Questions to all projects at once, as CQL2 text and words: rows as JSON, CSV or Arrow,"
            " and trends."
        ),
    ),
    ("laboratory", "Whose reports they are: name, address, logo."),
    ("archives", "Projects, campaigns and what a search finds as one zip that others read."),
    (
        "instruments",
        (
            "Hammers, sensors and analysers with their calibrations, which campaigns name by serial"
            " number."
        ),
    ),
    ("attachments", "Photos, drawings and notes beside what they show."),
    ("webhooks", "Messages of jobs and alarms to other systems, signed."),
    ("keys", "Keys, sessions of browsers, and who did what."),
    ("purge", "Remove for good what was deleted before."),
    ("health", "Is the service up, and does its database answer?"),
]
"""Headings of the documentation page in the order of the main job, each with a sentence."""


def headings(own: Mapping[str, str]) -> list[tuple[str, str]]:
    """All headings: those of kinds of job that declare their `own` stand after the models."""
    place = [name for name, _ in TAGS].index("models") + 1
    others = [each for each in own.items() if each[0] not in dict(TAGS)]
    return [*TAGS[:place], *others, *TAGS[place:]]
