"""Appearance of the simulated person in camera images: MuJoCo's skins on the bodies of the person's links."""

from collections.abc import Mapping

import mujoco
import numpy as np

from hric_control.plants import Model
from hric_core.geometry import homogeneous
from hric_core.geometry.transforms import rotation_from_quaternion
from hric_core.urdf import read
from hric_human.participant.settings import HUMAN, HumanSettings
from hric_skin import Skin, fitted
from hric_skin.skin import CLOTHES
from hric_skin.template import ZONES
from mujoco_ros_control.scene_spec import SceneFrame, quaternion


def person_model(settings: HumanSettings) -> tuple[Model, Skin]:
    """Return the model of a person at their initial pose, with a free root link, and their skin."""
    body = settings.body()
    root = settings.root(body)
    T_world_root = homogeneous(rotation_from_quaternion(root.orientation), np.array(root.position))
    model = Model(HUMAN, body.urdf, read(body.urdf), T_world_root, fixed=False)
    return model, fitted(body, settings.gripping(body))


def add_skin(spec: mujoco.MjSpec, frames: Mapping[str, SceneFrame], skin: Skin) -> None:
    """Add the skin of the person to a scene: one of MuJoCo's skins for each colour, since these have one each.

    Args:
        spec: scene with the person's links.
        frames: body and pose in it of each link in the scene, by "model::link".
        skin: skin of the person.
    """
    placed = [frames[f"{HUMAN}::{link}"] for link in skin.links]
    T_base_body = [T @ np.linalg.inv(at.T_body_link) for T, at in zip(skin.T_base_link, placed, strict=True)]
    of_triangle = skin.zones[skin.triangles[:, 0]]  # no triangle has two zones
    for zone in np.unique(of_triangle):
        used, faces = np.unique(skin.triangles[of_triangle == zone], return_inverse=True)
        weights = skin.weights[used]
        moving = [np.flatnonzero(column) for column in weights.T]
        own = [k for k, vertices in enumerate(moving) if len(vertices)]
        spec.add_skin(
            name=f"{HUMAN}::{ZONES[zone]}",
            rgba=[*CLOTHES[ZONES[zone]], 1.0],
            vert=skin.vertices[used].ravel(),
            face=faces.ravel(),
            bodyname=[placed[k].body for k in own],
            bindpos=np.ravel([T_base_body[k][:3, 3] for k in own]),
            bindquat=np.ravel([quaternion(T_base_body[k][:3, :3]) for k in own]),
            vertid=[moving[k].tolist() for k in own],
            vertweight=[weights[moving[k], k].tolist() for k in own],
        )
