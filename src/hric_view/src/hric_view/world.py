"""Objects of the simulated world in the window of a running system."""

from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped

from gazebo_msgs.msg import ModelStates
from hric_bags.records.object_record import models
from hric_core.geometry import pose_of_transform
from hric_core.node import Node
from hric_report.html.scene import SceneRobot
from hric_view.feeds import Feeds
from hric_view.live import LiveJoints


def objects(root: Node, feeds: Feeds) -> list[tuple[SceneRobot, LiveJoints]]:
    """Return the objects of the simulated world with their newest poses, and subscribe to the topic of the poses."""
    known = {model.name: model for model in models(root.param("robot/plant", {})) if not model.planes}
    live = {name: LiveJoints(()) for name in known}

    def push(message: Any) -> None:
        for name, pose in zip(message.name, message.pose, strict=True):
            if name in live:
                live[name].push_root(PoseStamped(pose=pose))

    if known:
        feeds.show("sim/model_states", ModelStates, push, lasting=True)
    none = np.zeros(1), np.zeros((1, 0))
    return [
        (SceneRobot("", model.xml, (), *none, pose=pose_of_transform(model.T_world_start)), live[name])
        for name, model in known.items()
    ]
