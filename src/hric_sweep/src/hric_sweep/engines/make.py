"""Choice of the engine from the options of the command line."""

import argparse
import os

from hric_core.errors import HricError
from hric_core.parameters import whole
from hric_core.wires import host_of, is_local, reached_by_others
from hric_sweep.engines.engine import Engine

JOBS = os.cpu_count() or 1
LOCAL = "local"
"""Value of --dask that means a cluster of this machine's processors, which ends with the command."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add --jobs, --dask and --insecure."""
    parser.add_argument("--jobs", type=int, help=f"runs at once (default: {JOBS}, the processors)")
    parser.add_argument(
        "--dask",
        metavar=f"ADDRESS|{LOCAL}",
        help=f"run on a Dask cluster: the address of its scheduler, such as tcp://10.0.0.1:8786; {LOCAL}: one of this "
        "machine. Workers: scripts/worker ADDRESS",
    )
    parser.add_argument(
        "--insecure",
        action="store_true",
        help="connect without certificate to a cluster that other machines reach: a network where everybody may run "
        "programs as you",
    )


def engine_of(given: argparse.Namespace, memory: float, runs: int) -> Engine:
    """Return the engine of a command.

    Args:
        given: arguments with the options of `add_options`.
        memory: memory limit of a worker [bytes].
        runs: maximum number of runs.

    Raises:
        HricError: options exclude each other, or the cluster is not reachable.
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
    """Refuse a remote address without certificate: anybody may be there, and responses are unpickled."""
    if insecure or address.startswith("tls://") or not (host := host_of(address)):
        return
    try:
        local = is_local(host)
    except ValueError as error:
        raise HricError(f"--dask {address}: {error}; valid: local, tcp://HOST:PORT or tls://HOST:PORT") from None
    if not local:
        raise HricError(reached_by_others(f"--dask {address}", "tls://HOST:PORT, in Dask's configuration"))
