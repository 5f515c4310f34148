"""Engine on a Dask cluster: chunks of tasks go to its workers, which execute them in separate processes (`chunks`)."""

import asyncio
import logging
import math
import os
import pickle
import platform
import socket
import threading
import uuid
import warnings
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import replace
from queue import SimpleQueue
from typing import Any

from hric_core.errors import HricError
from hric_sweep import task as runs
from hric_sweep.engines import chunks
from hric_sweep.engines.engine import Died, Differs, Lost, arrived, same
from hric_sweep.records import ReferenceRun, RunResponse, RunTask

CHUNK = 20
"""Number of tasks in a chunk, which is sent to a worker as one message; fewer only at the end of a batch."""
OPEN_EACH = 2
"""Number of open chunks per worker: one runs, one waits."""
CONNECT = 10.0
"""Timeout for a response of the scheduler [s]."""
WORKERS = 30.0
"""Timeout for the first worker to join [s]."""
STARTING = 300.0
"""Timeout for all workers to load their code and execute the reference run [s]."""
CLOSING = 30.0
"""Timeout for a cluster to close [s]."""
SCHEMES = ("tcp://", "tls://")
ON_WORKERS = chunks.__name__
"""Module whose functions the workers execute."""

Part = Sequence[tuple[RunTask, "Future[RunResponse]"]]
"""Tasks of a chunk, each with the future of its response."""


class DaskEngine:
    """Engine that executes tasks on a Dask cluster.

    Args:
        address: address of the scheduler, tcp://HOST:PORT or tls://HOST:PORT.
        memory: memory limit of a run [bytes].

    Raises:
        HricError: Dask is not installed, the address is invalid, or there is no scheduler or no worker.
    """

    def __init__(self, address: str, memory: float) -> None:
        self._connect(address, memory, None)

    @classmethod
    def local(cls, jobs: int, memory: float) -> "DaskEngine":
        """Return an engine with a Dask cluster on this machine (loopback interface), which ends with the engine."""
        distributed = _distributed()
        cluster = distributed.LocalCluster(
            n_workers=jobs,
            threads_per_worker=1,
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",
            memory_limit=None,
            silence_logs=logging.CRITICAL,
        )
        engine = cls.__new__(cls)
        engine._connect(cluster.scheduler_address, memory, cluster)
        return engine

    def _connect(self, address: str, memory: float, cluster: Any) -> None:
        self._distributed = _distributed()
        self._address, self._memory, self._cluster = address, memory, cluster
        self._lock = threading.Lock()
        self._buffer: list[tuple[RunTask, Future[RunResponse]]] = []
        self._open: set[Any] = set()
        self._ended: SimpleQueue[tuple[Any, Part] | None] = SimpleQueue()
        self._handshake: chunks.Handshake | None = None
        self._lost = ""
        self._client = _client(self._distributed, address)
        try:
            self._client.wait_for_workers(1, timeout=WORKERS)
            self._known = set(self._client.nthreads())
        except TimeoutError:
            self.close(now=True)
            raise HricError(
                f"the Dask scheduler at {address} has no workers, and none joined within {WORKERS:g} s; valid: start "
                f"workers, on any machine that has this workspace:  scripts/worker {address}"
            ) from None
        threading.Thread(target=self._collect, name="collects chunks", daemon=True).start()

    @property
    def workers(self) -> int:
        """Number of known workers."""
        return len(self._known)

    @property
    def window(self) -> int:
        """Number of tasks that may be open at once: OPEN_EACH chunks per worker."""
        return OPEN_EACH * CHUNK * self.workers

    # -- tasks ---------------------------------------------------------------------------------------------------------

    def submit(self, task: RunTask) -> "Future[RunResponse]":
        """Add a task to the current chunk, which is sent when it is full or by `flush`. Raises Lost."""
        self._check_lost()
        response: Future[RunResponse] = Future()
        self._buffer.append((task, response))
        if len(self._buffer) == CHUNK:
            self._send(self._buffer)
            self._buffer = []
        return response

    def flush(self) -> None:
        """Send the remaining tasks, in equal parts to all workers. Raises Lost."""
        self._check_lost()
        size = math.ceil(len(self._buffer) / self.workers)
        for first in range(0, len(self._buffer), size or 1):
            self._send(self._buffer[first : first + size])
        self._buffer = []

    def _send(self, part: Part) -> None:
        assert self._handshake is not None  # set by `check`
        packed = pickle.dumps(chunks.TaskChunk([task for task, _ in part], self._handshake))
        future = self._client.submit(_remote("execute"), packed, pure=False)
        with self._lock:
            self._open.add(future)
        future.add_done_callback(lambda done: self._ended.put((done, part)))

    def _collect(self) -> None:
        """Resolve the futures of finished chunks, in a separate thread; one round trip serves all finished ones."""
        going = True
        while going:
            ended = arrived(self._ended)
            going = None not in ended
            self._settle([chunk for chunk in ended if chunk is not None])

    def _settle(self, ended: Sequence[tuple[Any, Part]]) -> None:
        with self._lock:
            self._open.difference_update(done for done, _ in ended)
        for (done, part), result in zip(ended, self._fetched([done for done, _ in ended]), strict=True):
            try:
                outcomes = self._outcomes(done, result, len(part))
            except BaseException as error:
                outcomes = [error] * len(part)
            for (_, response), outcome in zip(part, outcomes, strict=True):
                if isinstance(outcome, BaseException):
                    response.set_exception(outcome)
                else:
                    response.set_result(outcome)

    def _fetched(self, ended: Sequence[Any]) -> Sequence[chunks.ChunkResult | BaseException | None]:
        """Return the results of chunks; None: there is no result, and the chunk's future has the reason."""
        try:
            return list(self._client.gather(dict(enumerate(ended)), errors="skip").values())
        except BaseException as error:
            return [error] * len(ended)

    def _outcomes(
        self, done: Any, result: chunks.ChunkResult | BaseException | None, count: int
    ) -> Sequence[RunResponse | BaseException]:
        """Return the outcomes of a chunk. Raises Lost, Differs; HricError: a worker cannot execute runs at all."""
        if result is None and done.status == "error":
            return [self._about(done.exception())] * count
        if result is None or self._says_lost(result):
            self._lost = f"connection to the Dask scheduler at {self._address} lost"
            raise Lost(self._lost)
        if isinstance(result, BaseException):
            raise result
        if result.differs:
            raise Differs(f"worker {result.worker}, which joined later, differs: {result.differs}")
        self._known.add(result.worker)
        return result.outcomes

    def _says_lost(self, result: chunks.ChunkResult | BaseException) -> bool:
        """Return True if the scheduler is lost: a client that has lost its connection raises errors of any type."""
        if isinstance(result, self._distributed.client.FutureCancelledError | OSError):
            return True
        return isinstance(result, Exception) and self._client.status != "running"

    def _about(self, error: BaseException) -> HricError:
        if isinstance(error, self._distributed.scheduler.KilledWorker):
            return Died("every Dask worker that executed the run ended")
        return HricError(f"a worker cannot execute runs: {_reason(error)}; valid: {self._start()}")

    def _start(self) -> str:
        return f"workers started by scripts/worker {self._address}, of the same revision"

    def _check_lost(self) -> None:
        if self._lost:
            raise Lost(self._lost)

    # -- handshake -----------------------------------------------------------------------------------------------------

    def check(self, reference: RunTask) -> ReferenceRun:
        """Have all workers execute the reference run; a worker that joins later does so before its first chunk.

        Raises:
            Differs: workers, named in the message, differ from the expected result.
            HricError: the connection to the scheduler was lost during the check.
        """
        handshake = chunks.Handshake(uuid.uuid4().hex, self._memory, reference)
        try:
            results = self._reference_runs(handshake)
        except HricError:
            raise
        except Exception as error:
            if not self._says_lost(error):
                raise
            raise self._lost_in_handshake() from error
        expected = same(results.items(), replace(_majority(results), code=runs.code_version()))
        self._handshake = replace(handshake, expected=expected)
        return expected

    def _lost_in_handshake(self) -> HricError:
        return HricError(f"the Dask scheduler at {self._address} was lost during the handshake; valid: restart it")

    def _reference_runs(self, handshake: chunks.Handshake) -> dict[str, ReferenceRun]:
        """Return the reference run's result of each worker, by its name. Raises Differs, HricError."""
        self._known = set(self._client.nthreads())
        packed = pickle.dumps(handshake)
        requests = {
            address: self._client.submit(
                _remote("reference"), packed, workers=[address], allow_other_workers=False, pure=False
            )
            for address in self._known
        }
        with suppress(TimeoutError, self._distributed.client.FutureCancelledError):
            self._distributed.wait(list(requests.values()), timeout=STARTING)
        ended = [address for address, future in requests.items() if future.status == "finished"]
        results: list[ReferenceRun] = self._client.gather([requests[address] for address in ended])
        problems = []
        for address, future in requests.items():
            if future.status == "error":
                problems.append(f"{address}: {_reason(future.exception())}")
            elif future.status == "pending":
                problems.append(f"{address}: no response within {STARTING:g} s")
            elif future.status != "finished":
                raise self._lost_in_handshake()
        if problems:
            raise Differs(
                "\n  ".join(["workers cannot execute the reference run:", *problems, f"valid: {self._start()}"])
            )
        return {f"{address} ({result.host})": result for address, result in zip(ended, results, strict=True)}

    def close(self, *, now: bool) -> None:
        """Disconnect from the scheduler, and end the cluster if it is local; `now`: cancel open tasks."""
        with self._lock:
            left = list(self._open)
        with suppress(Exception):  # errors while closing have no consequence
            if now and left and not self._lost:
                self._client.cancel(left, force=True)
        self._ended.put(None)
        with suppress(Exception):
            self._client.close(timeout=CLOSING)
        if self._cluster is not None:
            with suppress(Exception):
                self._cluster.close(timeout=CLOSING)


def _remote(name: str) -> Callable[[bytes], Any]:
    """Return a function that imports the function `name` of ON_WORKERS only when it is called, on a worker.

    The scheduler also unpickles tasks, and its machine may not have this workspace.
    """
    module = ON_WORKERS

    def execute(packed: bytes) -> Any:
        import importlib

        return getattr(importlib.import_module(module), name)(packed)

    return execute


def _majority(results: Mapping[str, ReferenceRun]) -> ReferenceRun:
    """Return the reference run's result that most workers have."""
    common = Counter(result.state_sha256 for result in results.values()).most_common(1)[0][0]
    return next(result for result in results.values() if result.state_sha256 == common)


def _reason(error: BaseException) -> str:
    if isinstance(error, Differs):
        return "its code was changed after the worker was started; valid: restart the worker"
    while error.__cause__ is not None:
        error = error.__cause__
    return " ".join(f"{type(error).__name__}: {error}".split())


def _client(distributed: Any, address: str) -> Any:
    """Return a client of the scheduler at an address. Raises HricError: there is no scheduler."""
    if not address.startswith(SCHEMES):
        raise HricError(f"--dask {address}: no address; valid: local, tcp://HOST:PORT or tls://HOST:PORT")
    try:
        host_port = distributed.comm.get_address_host_port(address, strict=True)
    except ValueError:
        raise HricError(f"--dask {address}: no address; valid: tcp://HOST:PORT, such as tcp://10.0.0.1:8786") from None
    security = distributed.Security()
    try:
        with socket.create_connection(host_port, CONNECT):
            identity = asyncio.run(asyncio.wait_for(_identity(distributed, address, security), CONNECT))
    except (OSError, OverflowError) as error:
        why = "the program at this address does not answer" if isinstance(error, TimeoutError) else str(error)
    except Exception as error:  # any error: an unknown program at the address may send anything
        why = str(error) if "TLS" in str(error) else "the program at this address uses a different protocol"
    else:
        if identity.get("type") == "Scheduler":
            name = f"hric-{platform.node()}-{os.getpid()}"
            return distributed.Client(address, security=security, timeout=CONNECT, name=name)
        why = f"the program at this address is a Dask {identity.get('type')}"
    raise HricError(
        f"no Dask scheduler responds at {address}: {' '.join(why.split())}; valid: start one there (scripts/scheduler) "
        "and use the address that it prints"
    )


async def _identity(distributed: Any, address: str, security: Any) -> Mapping[str, object]:
    """Return the identity (type, address and others) that the Dask process at an address reports."""
    arguments = security.get_connection_args("client")
    async with distributed.rpc(address, timeout=CONNECT, connection_args=arguments) as peer:
        identity: Mapping[str, object] = await peer.identity()
        return identity


def _distributed() -> Any:
    """Import Dask and suppress its log messages. Raises HricError: Dask is not installed."""
    os.environ.setdefault("DASK_LOGGING__DISTRIBUTED", "critical")  # for the processes that Dask starts
    try:
        import distributed  # imported here: its installation is optional
    except ImportError:
        raise HricError("--dask needs Dask, which is not installed:  scripts/setup --with cluster") from None
    for name in ("distributed", "tornado", "asyncio", *logging.root.manager.loggerDict):
        if name.split(".")[0] in ("distributed", "tornado", "asyncio"):
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    warnings.filterwarnings("ignore", module="distributed")
    return distributed
