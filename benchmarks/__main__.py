"""`python -m benchmarks` runs every benchmark, `python -m benchmarks NAME ...` those named.

A benchmark is a module of this package with a `main()` that prints a short table.
"""

from __future__ import annotations

import importlib
import pkgutil
import sys
import time
import traceback

import benchmarks


def available() -> list[str]:
    """Names of the modules of this package, in alphabetical order."""
    return sorted(module.name for module in pkgutil.iter_modules(benchmarks.__path__) if module.name != "__main__")


def run(names: list[str]) -> int:
    """Run the named benchmarks; how many of them failed."""
    failed = 0
    for name in names:
        main = getattr(importlib.import_module(f"benchmarks.{name}"), "main", None)
        if main is None:  # a module that benchmarks share
            continue
        print(f"\n=== {name}", flush=True)
        start = time.perf_counter()
        try:
            main()
        except Exception:  # noqa: BLE001 - one benchmark's failure must not hide the others' figures
            traceback.print_exc()
            failed += 1
        print(f"=== {name}: {time.perf_counter() - start:.1f} s", flush=True)
    return failed


if __name__ == "__main__":
    wanted = sys.argv[1:]
    unknown = sorted(set(wanted) - set(available()))
    if unknown:
        sys.exit(f"no benchmark named {', '.join(unknown)}; there are {', '.join(available())}")
    sys.exit(1 if run(wanted or available()) else 0)
