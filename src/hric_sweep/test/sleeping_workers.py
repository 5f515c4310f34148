"""Many workers of a Dask cluster in one process, whose runs only take time: what a scheduler and a sweep bear of them.

    python3 sleeping_workers.py ADDRESS COUNT

A task says how long it takes: `sleep` [s].
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
from hric_sweep.engines.engine import Response, Task

SHA256 = "0" * 64


def of_reference(packed: bytes) -> Response:
    """In place of `chunks.reference`."""
    return {"code": runs.code_version(), "state_sha256": SHA256, "host": platform.node()}


def sleeping(packed: bytes) -> chunks.Carried:
    """In place of `chunks.carry_out`."""
    tasks = pickle.loads(packed).tasks
    time.sleep(sum(task["sleep"] for task in tasks))
    return chunks.Carried(str(get_worker().address), [response(task) for task in tasks])


def response(task: Task) -> Response:
    """As large as one of a run."""
    return {
        "id": task["id"],
        "index": task["index"],
        "outputs": dict.fromkeys(task["outputs"], task["seed"] / 7.0),
        "failure": "",
        "state_sha256": SHA256,
        "processor": 0.0,
        "wall": task["sleep"],
        "host": platform.node(),
    }


async def serve(address: str, count: int) -> None:
    """Until the scheduler ends."""
    chunks.reference, chunks.carry_out = of_reference, sleeping
    with tempfile.TemporaryDirectory() as folder:
        here = [
            Worker(address, nthreads=1, host="127.0.0.1", dashboard=False, local_directory=folder, memory_limit=None)
            for _ in range(count)
        ]
        await asyncio.gather(*here)
        await asyncio.gather(*(worker.finished() for worker in here))


if __name__ == "__main__":
    asyncio.run(serve(sys.argv[1], int(sys.argv[2])))
