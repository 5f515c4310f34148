"""Measure processor time and size of exports per format; times are ratios to reading the bag without decoding it.

    python tests/benchmarks/export_cost.py RUN|BAG

Each format is exported separately into an empty folder, so that its cost includes reading the tables. The result is the
minimum of three measurements, which alternate with reading without decoding.
"""

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from rosbags.highlevel import AnyReader

from hric_bags.export import exporting, plain_formats, recording  # noqa: F401  (imports are not part of the cost)
from hric_bags.export.job import FORMATS, ExportRequest
from hric_bags.export.recording import ExportSource

ROUNDS = 3


def read_raw(source: ExportSource) -> None:
    """Read every message of the bag without decoding it."""
    with AnyReader([source.bag]) as reader:
        for _ in reader.messages():
            pass


def spent(what: Callable[[], object]) -> float:
    """Return the processor time of a call [s]."""
    begin = time.process_time()
    what()
    return time.process_time() - begin


def measure(
    source: ExportSource, formats: tuple[str, ...] = FORMATS
) -> tuple[float, dict[str, float], dict[str, float]]:
    """Return the processor time of reading without decoding [s], the ratio of each format to it, and sizes [MB].

    Formats for which the bag has no data are left out.
    """
    raw, costs, sizes = [], {kind: [] for kind in formats}, {}
    for _ in range(ROUNDS):
        raw.append(spent(lambda: read_raw(source)))
        for kind in list(costs):
            with tempfile.TemporaryDirectory() as folder:
                begin = time.process_time()
                result = exporting.export(source, ExportRequest((kind,)), Path(folder))
                cost = time.process_time() - begin
                sizes[kind] = sum(path.stat().st_size for paths in result.files.values() for path in paths) / 1e6
            if result.files:
                costs[kind].append(cost)
            else:
                del costs[kind]
    return min(raw), {kind: min(values) / min(raw) for kind, values in costs.items()}, sizes


def main() -> None:
    """Measure and print the table."""
    source = recording.find(sys.argv[1] if len(sys.argv) > 1 else "latest")
    raw, ratios, sizes = measure(source)
    print(
        f"{source.bag.name}, {source.bag.stat().st_size / 1e6:.1f} MB: read raw in {raw:.2f} s of CPU "
        "time\nformat          ratio     MB"
    )
    for kind, ratio in ratios.items():
        print(f"{kind:<14} {ratio:6.1f} {sizes[kind]:6.2f}")


if __name__ == "__main__":
    main()
