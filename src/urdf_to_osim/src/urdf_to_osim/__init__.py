"""Robot descriptions (URDF) as OpenSim models, proved against a rigid-body library."""

# ruff: noqa: E402  (the libraries must be loaded before the first module that imports them)

from urdf_to_osim.loading import load_opensim

load_opensim()

from urdf_to_osim.converter import Conversion as Conversion
from urdf_to_osim.converter import FrameMap as FrameMap
from urdf_to_osim.converter import JointMap as JointMap
from urdf_to_osim.converter import convert as convert
from urdf_to_osim.options import Options as Options
from urdf_to_osim.output import Written as Written
from urdf_to_osim.output import write as write
from urdf_to_osim.proof import Proof as Proof
from urdf_to_osim.proof import prove as prove
