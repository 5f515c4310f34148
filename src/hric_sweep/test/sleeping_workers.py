"""Many Dask workers in one process whose runs only sleep, to measure the load on scheduler and sweep.

    python3 sleeping_workers.py ADDRESS COUNT

A task takes as long as its timeout says [s].
"""

import asyncio
import pickle
import platform
import sys
import tempfile
import time

from distributed import Worker, get_worker

from hric_sweep import task as runs
from hric_sweep.engines import chunks
from hric_sweep.records import ReferenceRun, RunResponse, RunTask

SHA256 = "0" * 64


def of_reference(packed: bytes) -> ReferenceRun:
    """Replacement for `chunks.reference`: return a fixed result."""
    return ReferenceRun(runs.code_version(), SHA256, platform.node())


def sleeping(packed: bytes) -> chunks.ChunkResult:
    """Replacement for `chunks.execute`: sleep, then return made-up responses."""
    tasks = pickle.loads(packed).tasks
    time.sleep(sum(task.timeout for task in tasks))
    return chunks.ChunkResult(str(get_worker().address), [response(task) for task in tasks])


def response(task: RunTask) -> RunResponse:
    """Return a response as large as that of a run."""
    outputs = dict.fromkeys(task.outputs, task.seed / 7.0)
    return RunResponse(task.id, task.index, outputs, "", SHA256, 0.0, task.timeout, platform.node())


async def serve(address: str, count: int) -> None:
    """Until the scheduler ends."""
    chunks.reference, chunks.execute = of_reference, sleeping
    with tempfile.TemporaryDirectory() as folder:
        here = [
            Worker(address, nthreads=1, host="127.0.0.1", dashboard=False, local_directory=folder, memory_limit=None)
            for _ in range(count)
        ]
        await asyncio.gather(*here)
        await asyncio.gather(*(worker.finished() for worker in here))


if __name__ == "__main__":
    asyncio.run(serve(sys.argv[1], int(sys.argv[2])))
