"""Conversion of robot descriptions (URDF) to OpenSim models, verified by comparison with a rigid-body library."""

# ruff: noqa: E402  (the libraries must be loaded before the first module that imports them)

from importlib import import_module
from typing import TYPE_CHECKING, Any

from urdf_to_osim.loading import load_opensim

load_opensim()

from urdf_to_osim.converter import Conversion, FrameMap, JointMap, convert
from urdf_to_osim.options import Options
from urdf_to_osim.output import Written, write

if TYPE_CHECKING:
    from urdf_to_osim.proof.proof import Proof, prove

__all__ = ["Conversion", "FrameMap", "JointMap", "Options", "Proof", "Written", "convert", "prove", "write"]


def __getattr__(name: str) -> Any:
    """Import `Proof` and `prove` at their first use, since their rigid-body library (pinocchio) is slow to load."""
    if name in ("Proof", "prove"):
        return getattr(import_module("urdf_to_osim.proof.proof"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
