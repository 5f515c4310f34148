"""Benchmark case of the OpenSim converter."""

from collections.abc import Iterator
from contextlib import contextmanager

from cases import Block
from cases.arms import timed


@contextmanager
def convert() -> Iterator[Block]:
    """Measure the conversion of the Panda with hand, without meshes."""
    import panda_description
    from urdf_to_osim import Options
    from urdf_to_osim import convert as convert_urdf

    text = panda_description.load(fingers="prismatic")

    def run(n: int) -> None:
        for _ in range(n):
            convert_urdf(text, Options(meshes=False))

    yield timed(run, 3)
