"""Options of the commands that execute many runs, and the engine that these options choose."""

import argparse
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from hric_bags.arguments import RUNS
from hric_core.command import Argument
from hric_core.errors import HricError
from hric_core.parameters import whole
from hric_core.wires import host_of, is_local, reached_by_others
from hric_sweep.engines.engine import Differs, Lost, SweepEngine
from hric_sweep.journal import JournalError

JOBS = os.cpu_count() or 1
LOCAL = "local"
"""Value of --dask for a cluster of this machine's processors, which ends with the command."""


def engine_arguments(name: str) -> list[Argument]:
    """Return the options for engine, resumption, folder and progress bar; `name`: noun for --resume, such as sweep."""
    return [
        Argument("--jobs", type=int, help=f"number of parallel runs (default: {JOBS}, the number of processors)"),
        Argument(
            "--dask",
            metavar=f"ADDRESS|{LOCAL}",
            help=f"run on a Dask cluster: the address of its scheduler, such as tcp://10.0.0.1:8786; {LOCAL}: one of "
            "this machine. Start workers with scripts/worker ADDRESS",
        ),
        Argument(
            "--insecure",
            action="store_true",
            help="connect without certificate to a cluster that other machines can reach; only for a network in which "
            "everybody may run programs as you",
        ),
        Argument("--resume", metavar="DIR", help=f"resume an unfinished {name}"),
        RUNS,
        Argument("--quiet", action="store_true", help="no progress bar"),
    ]


@contextmanager
def engine_session(
    options: argparse.Namespace, memory: float, runs: int, resume: Callable[[], str]
) -> Iterator[SweepEngine]:
    """Yield the engine that the options choose, and close it; print the resume command on errors and Ctrl-C.

    Args:
        options: options of `engine_arguments`.
        memory: memory limit of a worker [bytes].
        runs: maximum number of runs.
        resume: function that returns the command to resume the runs; empty text: nothing was started.

    Raises:
        HricError: options exclude each other, or the cluster is not reachable.
        Lost: the engine was lost, a worker differs, or the last runs could not be stored; earlier runs are stored.
    """
    engine, now = engine_of(options, memory, runs), True
    try:
        yield engine
        now = False
    except KeyboardInterrupt:
        print(f"\ninterrupted; {f'resume with: {resume()}' if resume() else 'nothing was started'}", file=sys.stderr)
        raise
    except (Lost, Differs, JournalError) as error:
        if not resume():
            raise
        raise Lost(f"{error}\n  finished runs are stored; resume with: {resume()}") from None
    finally:
        engine.close(now=now)


def resume_command(folder: Path | None) -> str:
    """Return the command that resumes the runs in a folder; empty: there is no folder yet."""
    return "" if folder is None else f"hric sweep --resume {folder}"


def engine_of(options: argparse.Namespace, memory: float, runs: int) -> SweepEngine:
    """Create the engine that the options of a command choose.

    Args:
        options: options of `engine_arguments`.
        memory: memory limit of a worker [bytes].
        runs: maximum number of runs.

    Raises:
        HricError: options exclude each other, or the cluster is not reachable.
    """
    if options.jobs is not None:
        whole(minimum=1).checked(options.jobs, "--jobs")
    jobs = min(options.jobs or JOBS, runs)
    if options.dask is None:
        from hric_sweep.engines.pebble_engine import PebbleEngine

        return PebbleEngine(jobs, memory)
    from hric_sweep.engines.dask_engine import DaskEngine

    if options.dask == LOCAL:
        return DaskEngine.local(jobs, memory)
    if options.jobs is not None:
        raise HricError(
            f"--jobs has no effect on the cluster {options.dask}: its workers were started separately; valid: one of "
            f"the two, and scripts/worker {options.dask} --workers N"
        )
    _check_reach(options.dask, options.insecure)
    return DaskEngine(options.dask, memory)


def _check_reach(address: str, insecure: bool) -> None:
    """Refuse a remote scheduler without certificate: pickled responses of an unknown program could run any code."""
    if insecure or address.startswith("tls://") or not (host := host_of(address)):
        return
    try:
        local = is_local(host)
    except ValueError as error:
        raise HricError(f"--dask {address}: {error}; valid: local, tcp://HOST:PORT or tls://HOST:PORT") from None
    if not local:
        raise HricError(reached_by_others(f"--dask {address}", "tls://HOST:PORT, in Dask's configuration"))
