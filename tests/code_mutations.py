"""Change operators, numbers and arguments in the code one at a time, and find the changes that make no test fail.

    scripts/mutate [--only PATTERN...] [--again]

mutmut makes the mutants (changed copies of a function), in a copy of the packages below build/mutate; the workspace is
not changed. Results are stored: an interrupted run continues, and a later run tries the mutants of functions that were
changed since, and with --again also those that survived. Texts, constants, properties and other functions with
decorators are not mutated.

A mutant survives if no test fails. docs/mutations.md lists the survivors below the reason why no test has to detect
them. A survivor that is not listed is printed with its line, and the exit code is 1; the exit code is also 1 if a part
has a larger share of survivors than ALLOWED.
"""

import argparse
import os
import re
import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "build" / "mutate"
LINK = "workspace"
"""Name of the link to the workspace in the folder of the mutants, since tests must be below the folder of pytest."""
PAGE = ROOT / "docs" / "mutations.md"
PARTS = {
    "contact": "hric_assessment/contact",
    "ergonomics": "hric_assessment/ergonomics",
    "separation": "hric_assessment/separation",
    "statistics": "hric_sweep/statistics",
}
"""Folder of each part that is mutated, as PACKAGE/FOLDER."""
TESTS = {
    "hric_assessment": ("test_",),
    "hric_sweep": (
        "test_sweep_rare_events",
        "test_sweep_samplers",
        "test_sweep_sensitivity",
        "test_sweep_weights",
    ),
}
"""Prefixes of the names of the test files to run, by package."""
LEFT_OUT = ("test_bag_mutations.py", "test_assessment_cost.py")
"""Test files that are not run: they compute hundreds of verdicts, so their failure does not show where a fault is."""
ALLOWED = 0.1
"""Maximum share of the mutants of a part that may survive [1]."""
KILLED, SURVIVED, UNSEEN, UNTRIED = "killed", "survived", "no tests", "not checked"
"""States of a mutant in mutmut. In all others the tests took fifteen times as long, or the interpreter crashed."""
ROW = re.compile(r"^\| `([^`]+)` \| `(.*?)` \| `(.*?)` \|$", re.MULTILINE)
"""Pattern of a survivor's table row in docs/mutations.md: function, line before, line after."""


@dataclass
class Part:
    """Number of a part's mutants by state, and the names of the survivors."""

    counts: Counter[str] = field(default_factory=Counter)
    survivors: list[str] = field(default_factory=list)

    @property
    def tried(self) -> int:
        """Number of mutants that were tried."""
        return self.counts.total() - self.counts[UNTRIED]

    @property
    def share(self) -> float:
        """Share of the tried mutants that survived [1]."""
        return len(self.survivors) / max(self.tried, 1)


def settings() -> str:
    """Return the configuration of mutmut and pytest, as the text of a pyproject.toml."""
    files = [
        path
        for package, names in TESTS.items()
        for path in sorted((ROOT / "src" / package / "test").glob("test_*.py"))
        if path.name.startswith(names) and path.name not in LEFT_OUT and "mark.alone" not in path.read_text()
    ]
    arguments = ["-c", str(ROOT / "pyproject.toml"), f"--confcutdir={FOLDER}/mutants", "-m", "not slow and not live"]
    lines = {
        "source_paths": [f"src/{package}" for package in TESTS],
        "only_mutate": [f"src/{part}/*" for part in PARTS.values()],
        "pytest_add_cli_args": arguments,
        "pytest_add_cli_args_test_selection": [f"{LINK}/{path.relative_to(ROOT)}" for path in files],
    }
    return "[tool.mutmut]\n" + "".join(f"{key} = {value!r}\n" for key, value in lines.items())


def prepare() -> None:
    """Make the folder in which mutmut runs, with links to the packages and its configuration."""
    for package in TESTS:
        for link, target in (
            ("src", f"src/{package}"),
            ("share", ""),
        ):  # the code, and the configuration files it reads
            (FOLDER / link).mkdir(parents=True, exist_ok=True)
            if not (FOLDER / link / package).exists():
                (FOLDER / link / package).symlink_to(ROOT / "src" / package / target)
    (FOLDER / "mutants").mkdir(exist_ok=True)
    if not (FOLDER / "mutants" / LINK).exists():
        (FOLDER / "mutants" / LINK).symlink_to(ROOT)
    (FOLDER / "pyproject.toml").write_text(settings())


def results(names: Sequence[str] = ()) -> dict[str, Part]:
    """Return the results of the mutants whose names match, by part; without names: of all mutants."""
    from mutmut.__main__ import collect_source_file_mutation_data
    from mutmut.stats import status_by_exit_code

    parts = {name: Part() for name in PARTS}
    mutants, _ = collect_source_file_mutation_data(mutant_names=tuple(names))
    for data, mutant, code in mutants:
        folder = str(data.path.parent).removeprefix("src/")
        part = parts[next(name for name, own in PARTS.items() if folder == own)]
        status = status_by_exit_code[code]
        part.counts[status] += 1
        if status in (SURVIVED, UNSEEN):
            part.survivors.append(mutant)
    return parts


def whole(parts: Iterable[Part]) -> Part:
    """Return the sum of all parts."""
    parts = list(parts)
    return Part(sum((part.counts for part in parts), Counter()), [name for part in parts for name in part.survivors])


def change(mutant: str) -> tuple[str, str, str]:
    """Return the function of a mutant, and its changed line before and after the change, without comments."""
    from mutmut.mutation.diff_apply import find_mutant, get_diff_for_mutant

    diff = get_diff_for_mutant(mutant, path=find_mutant(mutant).path).splitlines()
    before, after = (
        " ".join(
            line[1:].split("  # ")[0].strip()
            for line in diff
            if line.startswith(sign) and not line.startswith(sign * 3)
        )
        for sign in "-+"
    )
    module, _, function = mutant.partition("__mutmut_")[0].rpartition(".")
    return f"{module}.{re.sub('^xǁ|^x_', '', function).replace('ǁ', '.')}", before, after


def explained() -> set[tuple[str, str, str]]:
    """Return the survivors that docs/mutations.md lists: function, line before, line after."""
    return {(row[1], row[2], row[3]) for row in ROW.finditer(PAGE.read_text().replace("\\|", "|"))}


def report(parts: dict[str, Part]) -> int:
    """Print the table, and each survivor that docs/mutations.md does not list; return the exit code."""
    known, failed = explained(), False
    print("| part | mutants | tried | a test fails | endless or a crash | not detected | share |")
    print("|---|---|---|---|---|---|---|")
    for name, part in (*parts.items(), ("total", whole(parts.values()))):
        lost, killed = len(part.survivors), part.counts[KILLED]
        counts = (part.counts.total(), part.tried, killed, part.tried - killed - lost, lost)
        print(f"| {name} | {' | '.join(map(str, counts))} | {100.0 * part.share:.1f} % |")
        failed |= part.share > ALLOWED
    for part in parts.values():
        for mutant in part.survivors:
            if (found := change(mutant)) not in known:
                failed = True
                print(mutant, "| `{}` | `{}` | `{}` |".format(*(one.replace("|", "\\|") for one in found)), sep="\n")
    return int(failed)


def run(given: argparse.Namespace) -> int:
    """Try the mutants that were not tried yet, and report the results."""
    prepare()
    os.chdir(FOLDER)
    import libcst
    from mutmut import __main__ as mutmut
    from mutmut.mutation import mutators
    from mutmut.stats import status_by_exit_code

    operators: Any = mutators.mutation_operators
    operators.remove((libcst.BaseString, mutators.operator_string))
    if not given.report:
        collect = mutmut.collect_source_file_mutation_data

        def collect_untried(**names: Any) -> Any:
            mutants, files = collect(**names)
            wanted = (SURVIVED, UNSEEN) if given.again else ()
            return [row for row in mutants if row[2] is None or status_by_exit_code[row[2]] in wanted], files

        mutmut.collect_source_file_mutation_data = collect_untried
        mutmut._run(tuple(given.only) or ("*",), 1)
        mutmut.collect_source_file_mutation_data = collect
    return report(results(given.only))


def main(arguments: Sequence[str]) -> int:
    """Run the command and return its exit code."""
    parser = argparse.ArgumentParser("scripts/mutate", description=__doc__.split("\n")[0])
    parser.add_argument(
        "--only", nargs="+", default=[], metavar="PATTERN", help="patterns of mutants to try, such as '*separation*'"
    )
    parser.add_argument("--again", action="store_true", help="also try the mutants that survived before")
    parser.add_argument("--report", action="store_true", help="print the stored results without trying mutants")
    return run(parser.parse_args(list(arguments)))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
