"""Emulated Motive: a scene, the protocol without sockets, and a server on UDP."""

from hric_core.geometry import Track
from mocap_natnet.server.motive import Motive
from mocap_natnet.server.scene import OCCLUSION, TRIANGLE, Body, Faults, Plate, Scene
from mocap_natnet.server.server import MotiveServer
from mocap_natnet.server.settings import TRANSPORTS, Settings
from mocap_natnet.server.skeleton import Bone, Skeleton
from mocap_natnet.server.sources import Sinusoid, Source, from_file

__all__ = [
    "OCCLUSION",
    "TRANSPORTS",
    "TRIANGLE",
    "Body",
    "Bone",
    "Faults",
    "Motive",
    "MotiveServer",
    "Plate",
    "Scene",
    "Settings",
    "Sinusoid",
    "Skeleton",
    "Source",
    "Track",
    "from_file",
]
