"""Last output of scripts/test, from the JUnit files of its pytest runs: failed tests, measured figures, and a line that
counts each test once.

    python tests/closing_line.py CODE FOLDER

CODE is the exit code of the last pytest run that failed, 0 if none failed. The figures are also written to
FOLDER/figures.txt.
"""

import json
import sys
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path


@dataclass
class Results:
    """Results of several pytest runs together.

    Attributes:
        passed: number of passed tests by kind.
        failed: names of tests that failed, also in set-up, teardown or import of their file.
        skipped: number of skipped tests by reason.
        not_selected: number of deselected tests by marker.
        figures: name, value and unit of each measured figure.
        runs_on: number of passed tests by backend or engine.
        seconds: wall time of the runs together [s].
    """

    passed: Counter[str] = field(default_factory=Counter)
    failed: list[str] = field(default_factory=list)
    skipped: Counter[str] = field(default_factory=Counter)
    not_selected: Counter[str] = field(default_factory=Counter)
    figures: list[tuple[str, float, str]] = field(default_factory=list)
    runs_on: Counter[str] = field(default_factory=Counter)
    seconds: float = 0.0

    @property
    def ran(self) -> int:
        """Number of tests that passed or failed."""
        return self.passed.total() + len(self.failed)


def read(files: Iterable[Path]) -> Results:
    """Return the results in all JUnit files together.

    A test that failed, and then again in its teardown, is listed twice in a file and counts once.
    """
    results = Results()
    for file in files:
        root, cases = ET.parse(file).getroot(), dict[str, ET.Element]()
        results.seconds += sum(float(suite.get("time", 0.0)) for suite in root.iter("testsuite"))
        for case in root.iter("testcase"):
            name = f"{case.get('classname')}::{case.get('name')}".removeprefix("::")
            cases[name] = cases[name] if name in cases and _failed(cases[name]) else case
        for found in root.iterfind("testsuite/properties/property[@name='not selected']"):
            results.not_selected.update(json.loads(found.attrib["value"]))
        for name, case in cases.items():
            _add(results, name, case)
    return results


def _failed(case: ET.Element) -> bool:
    return case.find("failure") is not None or case.find("error") is not None


def _add(results: Results, name: str, case: ET.Element) -> None:
    properties = [(found.attrib["name"], found.attrib["value"]) for found in case.iterfind("properties/property")]
    results.figures += [tuple(json.loads(value)) for key, value in properties if key == "figure"]
    skipped = case.find("skipped")
    if _failed(case):
        results.failed.append(name)
    elif skipped is not None:
        results.skipped[skipped.attrib["message"].removeprefix("Skipped: ")] += 1
    else:
        results.passed[dict(properties).get("kind", "unit")] += 1
        results.runs_on.update(value for key, value in properties if key == "runs on")


def table(figures: Iterable[tuple[str, float, str]]) -> str:
    """Return the figures as text, one line each."""
    lines = sorted(figures)
    width = max((len(name) for name, *_ in lines), default=0)
    return "".join(f"{name:{width}s} {value:>10.4g} {unit}\n" for name, value, unit in lines)


def _counted(word: str, counts: Counter[str]) -> str:
    """Return a total with its parts, such as "7 skipped (4 no camera, 3 no display)"."""
    parts = ", ".join(f"{count} {name}" for name, count in sorted(counts.items(), key=lambda item: (-item[1], item[0])))
    return f"{counts.total()} {word} ({parts})" if parts else f"0 {word}"


def line(results: Results, code: int) -> str:
    """Return the closing line."""
    verdict = f"FAILED (code {code})" if code else "all passed" if results.ran else "nothing ran"
    counts = [
        _counted("passed", results.passed),
        f"{len(results.failed)} failed",
        _counted("skipped", results.skipped),
        _counted("not selected", results.not_selected),
    ]
    return f"scripts/test: {', '.join(counts)}; {results.seconds:.0f} s; {verdict}"


def main(code: int, folder: Path) -> int:
    """Print the results; return the exit code of scripts/test, which is 5 if no test ran."""
    results = read(sorted(folder.glob("*.xml")))
    figures = table(results.figures)
    (folder / "figures.txt").write_text(figures)
    if figures:
        print(f"\nFigures (also in {folder / 'figures.txt'}):\n{figures}")
    for name in results.failed:
        print(f"failed: {name}")
    if results.runs_on:
        print(f"contract and plants: {_counted('passed', results.runs_on)}")
    print(line(results, code))
    return code or (0 if results.ran else 5)


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), Path(sys.argv[2])))
