"""`python -m tools.branches` runs the tests, then the long ones, and lists branches that the long ones
alone take. There should be none: each long test has a short form that always runs.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

BUILD = Path("build/branches")
Branches = set[tuple[str, int, int]]


def covered(name: str, marked: str) -> tuple[Branches, float]:
    """Branches that the tests with these marks take, and their share in percent."""
    data = BUILD / name
    coverage = [sys.executable, "-m", "coverage"]
    environment = os.environ | {"COVERAGE_FILE": str(data.resolve())}
    tests = ["run", "-m", "pytest", "-q", "-n", "3", "--dist", "worksteal", "-m", marked]
    subprocess.run([*coverage, *tests], env=environment, check=True)
    subprocess.run([*coverage, "combine", "-q"], env=environment, check=True)
    written = data.with_suffix(".json")
    subprocess.run([*coverage, "json", "-q", "-o", str(written)], env=environment, check=True)
    report = json.loads(written.read_text())
    taken = {
        (file, *branch)
        for file, found in report["files"].items()
        for branch in found["executed_branches"]
    }
    totals = report["totals"]
    return taken, 100 * totals["covered_branches"] / totals["num_branches"]


def main() -> None:
    """Run both, print, and fail where the long tests alone take a branch."""
    BUILD.mkdir(parents=True, exist_ok=True)
    short, share = covered("short", "not long")
    long, share_long = covered("long", "long")
    alone = sorted(long - short)
    print(f"branches taken: {share:.2f} % by the tests, {share_long:.2f} % by the long ones")
    for file, line, to in alone:
        print(f"{file}:{line} -> {to}: by the long tests alone")
    sys.exit(len(alone) > 0)


if __name__ == "__main__":
    main()
