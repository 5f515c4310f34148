"""What moves a body: a controller's joint torque from late and noisy senses, within the strength of each joint.

    human = HumanControl(body, {"type": "hric_human/ImpedanceArm"}, seed=0)
    human.start(0.0)
    tau = human.update(0.0, q, dq)              # each cycle

A controller is a class found by name, as those of robots are: see `controller`.
"""

from hric_human.control.controller import HumanController, Person, Senses
from hric_human.control.inverse_kinematics import OutOfReachError
from hric_human.control.surroundings import ControlSettings, HumanControl, SenseSettings

__all__ = [
    "ControlSettings",
    "HumanControl",
    "HumanController",
    "OutOfReachError",
    "Person",
    "SenseSettings",
    "Senses",
]
