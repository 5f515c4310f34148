"""Emulated Motive: a scene, the protocol without sockets, and a server on UDP."""

from hric_core.geometry import Track
from mocap_natnet.server.motive import Motive
from mocap_natnet.server.scene import OCCLUSION, TRIANGLE, CameraFaults, SceneBody, ServedPlate, ServedScene
from mocap_natnet.server.server import MotiveServer
from mocap_natnet.server.settings import TRANSPORTS, MotiveSettings
from mocap_natnet.server.skeleton import Bone, ServedSkeleton
from mocap_natnet.server.sources import SinusoidSource, Source, from_file

__all__ = [
    "OCCLUSION",
    "TRANSPORTS",
    "TRIANGLE",
    "Bone",
    "CameraFaults",
    "Motive",
    "MotiveServer",
    "MotiveSettings",
    "SceneBody",
    "ServedPlate",
    "ServedScene",
    "ServedSkeleton",
    "SinusoidSource",
    "Source",
    "Track",
    "from_file",
]
