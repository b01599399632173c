"""`python -m tools.branches` runs the tests, then the long ones, and lists branches that the long ones
alone take. There should be none: each long test has a short form that always runs. Only the tests of
some files are run where these are named.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

BUILD = Path("build/branches")
GOOD = (0, 5)  # all tests pass; there is none with these marks in the files
Branches = set[tuple[str, int, int]]


def covered(name: str, marked: str, files: list[str]) -> tuple[Branches, float]:
    """Branches that the tests with these marks, of some files or of all, take, and their share in
    percent.
    """
    data = BUILD / name
    coverage = [sys.executable, "-m", "coverage"]
    environment = os.environ | {"COVERAGE_FILE": str(data.resolve())}
    tests = ["run", "-m", "pytest", "-q", "-n", "3", "--dist", "worksteal", "-m", marked, *files]
    if subprocess.run([*coverage, *tests], env=environment, check=False).returncode not in GOOD:
        sys.exit(f"tests that are {marked} fail: what they take is not compared")
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
    shutil.rmtree(BUILD, ignore_errors=True)  # what a run that was stopped left would be counted
    BUILD.mkdir(parents=True)
    files = sys.argv[1:]
    short, share = covered("short", "not long", files)
    long, share_long = covered("long", "long", files)
    alone = sorted(long - short)
    print(f"branches taken: {share:.2f} % by the tests, {share_long:.2f} % by the long ones")
    for file, line, to in alone:
        print(f"{file}:{line} -> {to}: by the long tests alone")
    sys.exit(len(alone) > 0)


if __name__ == "__main__":
    main()
