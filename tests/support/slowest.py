"""The twenty slowest tests of a run, each with the sentence of its docstring that says what it is
worth.
"""

from collections import Counter
from collections.abc import Generator

import pytest

SHOWN = 20


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item,
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    if report.when == "call" and isinstance(item, pytest.Function):
        worth = (item.function.__doc__ or "").partition("\n\n")[0]
        report.user_properties.append(("worth", " ".join(worth.split())))
    return report


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    seconds: Counter[str] = Counter()
    worth: dict[str, object] = {}
    for reports in terminalreporter.stats.values():
        for report in reports:
            if isinstance(report, pytest.TestReport):
                seconds[report.nodeid] += report.duration
                worth.update({report.nodeid: dict(report.user_properties).get("worth")})
    if len(seconds) > SHOWN:
        terminalreporter.section(f"the slowest {SHOWN} of {len(seconds)} tests")
        for name, lasted in seconds.most_common(SHOWN):
            terminalreporter.line(f"{lasted:6.1f} s  {name}\n          {worth[name]}")
