"""Process of one case of the benchmark: python3 tests/benchmarks/worker.py CASE

It prints `ready` after a first block of work. Then it does a block for each line on its input, and prints `time` and
the time of a unit [s].
"""

import sys

import cases


def main() -> None:
    """Measure blocks until the input ends."""
    with cases.make(sys.argv[1]) as block:
        if not cases.CASES[sys.argv[1]].several:
            block()
        print("ready", flush=True)
        for _ in sys.stdin:
            print("time", repr(block()), flush=True)


if __name__ == "__main__":
    main()
