"""One case of the benchmark in a process of its own: python3 tests/benchmarks/worker.py CASE

For each line on its input it does a block and answers `time` and what a unit took [s]; it begins with `ready`, after
one block to warm up.
"""

import sys

import cases


def main() -> None:
    """Answer until the input ends."""
    with cases.make(sys.argv[1]) as block:
        if not cases.CASES[sys.argv[1]].several:
            block()
        print("ready", flush=True)
        for _ in sys.stdin:
            print("time", repr(block()), flush=True)


if __name__ == "__main__":
    main()
