"""Words that names of the code do not use, and the field's term for each.

`python -m tools.words` lists the names that use one, and ends with 1 where there are any;
`python -m tools.words service/platform/access` reads that folder alone. `make check` runs it. Names that
become JSON or stand in REST are contracts and stay: `CONTRACTS` says where.
"""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

PACKAGES = ("fecore", "modalbase", "service")


WORDS = {
    "likest": "force_best_match",
    "torn": "oscillating_modes",
    "swinging": "PairingCycleError, pairing cycle",
    "without_rest": "nonconvergence",
    "rests": "converged",
    "still": "stalled",
    "loose": "unverified_basis",
    "stretches": "damage intervals",
    "excursions": "systematic effects",
    "excursion": "systematic effect",
    "pulls": "bias_sensitivity",
    "pull": "bias_sensitivity (of an estimate), score (of a pole)",
    "belief": "mode inclusion probability",
    "stray": "spurious_mode_penalty",
    "alone": "unpaired_cost, or what the thing is",
    "missed": "rms_residual; a vector is missed_by",
    "away": "prior_z_score, or what the distance is",
    "standing": "admissible_rivals",
    "spanning": "model_averaged_posterior",
    "in_doubt": "has_uncertain_modes",
    "lawful": "law_modes",
    "suspended": "suspension_modes",
    "lever": "pole_jacobian",
    "spare": "one_minus_leverage",
    "parting": "close_mode_separation",
    "parted": "close_mode_separation",
    "grow": "forward selection",
    "grown": "extended",
    "tones": "harmonics",
    "beads": "junction_beams",
    "given_up": "overlap_correction",
    "led": "dependent (nodes)",
    "leaders": "independent (nodes)",
    "heights": "frf_scale_check",
    "placing": "hit_location",
    "aside": "subprocess_read",
    "tickets": "queue_adapter",
    "bring_back": "restore",
    "give_back": "requeue",
    "demands": "metadata_schema",
    "heard": "on_notify",
    "said": "notes, or the thing's name",
    "found": "findings, or the thing's name",
    "wanted": "query, or the thing's name",
    "asked": "query, request, or the thing's name",
    "anything": "the class, called",
    "losses": "ReadReport",
    "ignored": "SkippedCard",
    "moves": "ModeEffects",
}
"""Word, or words joined by `_`, in lower case; and what to write."""

CONTRACTS: dict[str, str] = {
    "FileNotFoundError": "Python",
    "ModuleNotFoundError": "Python",
    "not_found_as": "HTTP: 404 Not Found",
    "get_found_archive": "REST: an operation id",
    "missed_percent": "REST: a member of a shape",
    "NotFound": "HTTP: 404 Not Found",
    "ignored": "REST, stored models (service/compute/models/keeping.py), docs/library.md",
    "leaders": "stored models (service/compute/models/keeping.py): field of modalbase's Link",
    "losses": "database: jobs.losses",
    "missed": "REST: damping_laws of a result",
    "missed_by": "REST: the common law of a joint result",
    "get_found_data": "REST: an operation id",
    "AloneOut": "REST: a schema",
    "ForecastFoundOut": "REST: a schema",
    "FoundFrameOut": "REST: a schema",
    "FoundFramesOut": "REST: a schema",
    "FoundModelOut": "REST: a schema",
    "IgnoredOut": "REST: a schema",
    "SaidOut": "REST: a schema",
    "fecore/updating/campaigns.py:alone": "REST: a campaign of a joint result",
    "fecore/updating/result.py:said": "REST: a cause in a result",
    "fecore/updating/contradictions.py:said": "REST: a cause in a result",
    "fecore/updating/elastic_findings.py:said": "REST: a cause in a result",
    "fecore/updating/sampling.py:moves": "emcee: a parameter",
    "fecore/modal/identify.py:found": "the library: Identification.found",
    "fecore/modal/recordings.py:found": "the library: Identification.found",
    "fecore/modal/result.py:found": "the library: Identification.found",
    "service/compute/identifying.py:found": "the library: Identification.found",
    "service/nouns/search/routes.py:Found": "REST: a schema",
    "service/tasks/forecast/task.py:found": "REST: a forecast",
    "service/tasks/model/routes.py:found": "REST: a model",
    "service/tasks/import_file/routes.py:found": "REST: an import",
    "service/pages/measurements.py:found": "REST: an import",
    "service/nouns/imports/operations.py:found": "database: imports.found",
    "service/tasks/import_file/intake.py:found": "database: imports.found",
    "service/tasks/import_file/script_routes.py:found": "database: imports.found",
    "service/nouns/updates/result_schemas.py:alone": "REST: a campaign of a joint result",
    "service/nouns/updates/result_schemas.py:said": "REST: a cause in a result",
}
"""Names that stay though they use such a word, each with where it is stated; one behind a file and
`:` stays in that file alone.
"""


def words_of(name: str) -> list[str]:
    """The words of a name: `InDoubt` and `in_doubt` are `in`, `doubt`."""
    parts = "".join(f"_{c.lower()}" if c.isupper() else c for c in name).split("_")
    return [part for part in parts if part]


def names(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Line and name of each name that a module makes: what it defines, binds, or passes on."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            yield node.lineno, node.name
        elif isinstance(node, ast.arg | ast.keyword) and node.arg:
            yield node.lineno, node.arg
        elif isinstance(node, ast.Name):
            yield node.lineno, node.id
        elif isinstance(node, ast.Attribute):
            yield node.lineno, node.attr
        elif isinstance(node, ast.alias) and node.asname:
            yield node.lineno, node.asname


def word_in(name: str, file: str = "") -> str | None:
    """The word of `WORDS` that a name uses; None where it uses none, or is a contract."""
    if name in CONTRACTS or f"{file}:{name}" in CONTRACTS:
        return None
    parts = f"_{'_'.join(words_of(name))}_"
    return next((word for word in WORDS if f"_{word}_" in parts), None)


def main(folders: list[str]) -> int:
    """Print each name that uses a word of the list, with its place and what to write."""
    faults = []
    for path in sorted(path for folder in folders for path in Path(folder).rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for line, name in [(1, path.stem), *sorted(set(names(tree)))]:
            if (word := word_in(name, str(path))) is not None:
                faults.append(f"{path}:{line}: {name}: write {WORDS[word]} for {word}")
    print("\n".join(faults))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:] or list(PACKAGES)))
