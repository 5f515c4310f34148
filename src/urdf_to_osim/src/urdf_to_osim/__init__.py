"""Robot descriptions (URDF) as OpenSim models, proved against a rigid-body library."""

# ruff: noqa: E402  (the libraries must be loaded before the first module that imports them)

from importlib import import_module
from typing import TYPE_CHECKING, Any

from urdf_to_osim.loading import load_opensim

load_opensim()

from urdf_to_osim.converter import Conversion as Conversion
from urdf_to_osim.converter import FrameMap as FrameMap
from urdf_to_osim.converter import JointMap as JointMap
from urdf_to_osim.converter import convert as convert
from urdf_to_osim.options import Options as Options
from urdf_to_osim.output import Written as Written
from urdf_to_osim.output import write as write

if TYPE_CHECKING:
    from urdf_to_osim.proof import Proof as Proof
    from urdf_to_osim.proof import prove as prove


def __getattr__(name: str) -> Any:
    """The proof, whose rigid-body library takes half as long to load as OpenSim, is loaded by who uses it."""
    if name in ("Proof", "prove"):
        return getattr(import_module("urdf_to_osim.proof"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
