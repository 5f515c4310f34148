"""The simulated arm without a ROS master and with the shipped configuration, for tests of one controller."""

from pathlib import Path

import yaml

import panda_description
from hric_control.manager.controller_manager import ControllerManager
from hric_core import plugins
from hric_core.local.node import LocalNode

YAML = Path(__file__).parents[2] / "hric_bringup" / "config" / "controllers.yaml"
CONFIG = Path(__file__).parents[1] / "config"


class ArmRig:
    """`run(seconds)` cycles the arm with one controller; `on_cycle(time)` is called after each update.

    Args:
        controller: name of the instance in controllers.yaml.
        start: load and start it.
        changes: its parameters.
    """

    def __init__(self, controller, start=True, **changes):
        params = {}
        for path in (YAML, *CONFIG.glob("*.yaml")):
            params |= yaml.safe_load(path.read_text().replace("$(arg arm_id)", "panda"))
        params[controller].update(changes)
        params["robot_description"] = panda_description.load(arm_id="panda", meshes=False)
        params["robot"] = {
            "arm_id": "panda",
            "real_time_factor": 0.0,
            "plant": {"collision": False, "self_collision": False},
        }
        self.node = LocalNode(params)
        self.hw = plugins.find(plugins.ROBOT_HW, "franka_sim/FrankaHWSim")()
        self.hw.init(self.node, self.node.child("robot"))
        self.node.clock = lambda: self.hw.loop.time
        self.manager = ControllerManager(self.hw, self.node)
        self.manager.loop_running = False
        self.messages = {}
        self.node.tap(lambda topic, message, time: self.messages.setdefault(topic, []).append(message))
        self.torques = []
        self.name = controller
        self.manager.load(controller)
        if start:
            self.manager.switch([controller], [])

    @property
    def state(self):
        return self.hw.robot_state

    def run(self, seconds, on_cycle=None, reset=False):
        end, first = self.hw.loop.time + seconds - 5e-4, reset

        def cycle(time, period, reset_controllers):
            nonlocal first
            self.manager.update(time, period, reset_controllers or first)
            first = False
            self.torques.append(list(self.hw.states.effort))
            if on_cycle is not None:
                on_cycle(time)
            if time + self.hw.loop.time_step >= end:
                self.hw.stop()
            return True

        self.hw.run(cycle)
        return self

    def publish(self, topic, message):
        self.node.advertise(f"{self.name}/{topic}", type(message)).publish(message)
