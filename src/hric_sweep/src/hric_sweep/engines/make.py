"""Which engine a command uses: the options of the command line, and what they stand for."""

import argparse
import os

from hric_bags.arguments import RUNS
from hric_core.command import Argument
from hric_core.errors import HricError
from hric_core.parameters import whole
from hric_core.wires import host_of, is_local, reached_by_others
from hric_sweep.engines.engine import Engine

JOBS = os.cpu_count() or 1
LOCAL = "local"
"""Instead of an address: a cluster of this machine's processors, that ends with the command."""


def engine_arguments(work: str) -> list[Argument]:
    """Return the options of a command that runs many tasks and can go on with them; work: its name, for --help."""
    return [
        Argument("--jobs", type=int, help=f"runs at once (default: {JOBS}, the processors)"),
        Argument(
            "--dask",
            metavar=f"ADDRESS|{LOCAL}",
            help=f"run on a Dask cluster: the address of its scheduler, such as tcp://10.0.0.1:8786; {LOCAL}: one of "
            "this machine. Workers: scripts/worker ADDRESS",
        ),
        Argument(
            "--insecure",
            action="store_true",
            help="connect without certificate to a cluster that other machines reach: a network where everybody may "
            "run programs as you",
        ),
        Argument("--resume", metavar="DIR", help=f"go on with a {work} that was ended before its end, by whatever"),
        RUNS,
        Argument("--quiet", action="store_true", help="no progress bar"),
    ]


def engine_of(given: argparse.Namespace, memory: float, runs: int) -> Engine:
    """The engine of a command.

    Args:
        given: of `engine_arguments`.
        memory: that a worker may take [bytes].
        runs: that there are at most.

    Raises:
        HricError: options that do not go together, or a cluster that is not there.
    """
    if given.jobs is not None:
        whole(minimum=1).checked(given.jobs, "--jobs")
    jobs = min(given.jobs or JOBS, runs)
    if given.dask is None:
        from hric_sweep.engines.pebble_engine import PebbleEngine

        return PebbleEngine(jobs, memory)
    from hric_sweep.engines.dask_engine import DaskEngine

    if given.dask == LOCAL:
        return DaskEngine.local(jobs, memory)
    if given.jobs is not None:
        raise HricError(
            f"--jobs says nothing about the cluster {given.dask}: it has the workers that were started for it; valid: "
            f"one of the two, and scripts/worker {given.dask} --workers N"
        )
    _check_reach(given.dask, given.insecure)
    return DaskEngine(given.dask, memory)


def _check_reach(address: str, insecure: bool) -> None:
    """Raises HricError: what is at the address without certificate may be anybody, whose responses run as programs."""
    if insecure or address.startswith("tls://") or not (host := host_of(address)):
        return
    try:
        local = is_local(host)
    except ValueError as error:
        raise HricError(f"--dask {address}: {error}; valid: local, tcp://HOST:PORT or tls://HOST:PORT") from None
    if not local:
        raise HricError(reached_by_others(f"--dask {address}", "tls://HOST:PORT, in Dask's configuration"))
