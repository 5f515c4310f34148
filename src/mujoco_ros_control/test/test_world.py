"""The scene is compiled again when models are spawned or deleted."""

import numpy as np
import pytest

from hric_core.errors import HricError
from mujoco_ros_control import world

BALL = """<robot name="ball"><link name="ball">
  <inertial><mass value="1"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>
  <collision><geometry><sphere radius="0.1"/></geometry></collision>
</link></robot>"""


def test_a_model_that_mujoco_refuses_is_gone_and_a_reset_goes_on_without_it(make_plant, panda_urdf, monkeypatch):
    plant, far = make_plant(panda_urdf), np.eye(4)
    far[:3, 3] = 3.0, 0.0, 1.0

    def refused(*_):
        raise HricError("MuJoCo cannot compile the scene")

    with monkeypatch.context() as patch:
        patch.setattr(world, "CompiledScene", refused)
        with pytest.raises(HricError, match="cannot compile"):
            plant.spawn("ball", BALL, far)
    plant.reset([0.0] * 7)
    assert plant.model_names() == [] and "ball::ball" not in plant.world.scene.bodies
    plant.spawn("ball", BALL, far)
    plant.reset([0.0] * 7)
    assert plant.model_names() == ["ball"] and "ball::ball" in plant.world.scene.bodies
