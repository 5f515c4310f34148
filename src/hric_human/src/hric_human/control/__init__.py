"""Control of a human body: joint torque from delayed and noisy senses, within the strength of each joint.

    human = HumanControl(body, {"type": "hric_human/ImpedanceArm"}, seed=0)
    human.start(0.0)
    tau = human.update(0.0, q, dq)              # each cycle

Controllers are plugins, found by name: see `controller`.
"""

from hric_human.control.controller import HumanController, Person, Senses
from hric_human.control.human_control import ControlSettings, HumanControl, SenseSettings
from hric_human.control.inverse_kinematics import OutOfReachError

__all__ = [
    "ControlSettings",
    "HumanControl",
    "HumanController",
    "OutOfReachError",
    "Person",
    "SenseSettings",
    "Senses",
]
