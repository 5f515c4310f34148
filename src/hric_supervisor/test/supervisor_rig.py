"""An arm and a person for tests of the supervisor's core: the Panda as described, and a ball or a body before it."""

import math

import numpy as np

import panda_description
from hric_core.geometry import Pose
from hric_human.body import Subject, describe
from hric_supervisor.arm import ArmShape, ArmState
from hric_supervisor.decision import UNHINDERED, Supervisor
from hric_supervisor.person import BodyShape, Observation
from hric_supervisor.settings import SupervisorSettings

JOINTS = [f"panda_joint{i}" for i in range(1, 8)]
READY = np.array([0.0, -math.pi / 4, 0.0, -3 * math.pi / 4, 0.0, math.pi / 2, math.pi / 4])
STILL = np.zeros(7)
ARM = ArmShape(panda_description.load(arm_id="panda", meshes=False), JOINTS)
PERIOD = 0.01


def ball(stamp, x, region="chest", radius=0.1, y=0.0, z=0.5, frame="world"):
    """Return the observation of a person that consists of one ball."""
    ends = np.tile([float(x), float(y), float(z)], (1, 2, 1))
    return Observation(stamp, frame, ends, np.array([radius]), ("part",), ((region,),), (None,))


def body():
    return describe(Subject(code="S01", mass=75.0, height=1.75, sex="male", parts="upper_body"))


def shape(x=2.0):
    return BodyShape(body(), Pose((x, 0.0, 0.2), (0.0, 0.0, 1.0, 0.0)))


class Cell:
    """A supervisor that decides at 100 Hz."""

    def __init__(self, **settings):
        self.supervisor = Supervisor(SupervisorSettings(**settings), ARM)
        self.time, self.decisions = 0.0, []

    def decide(self, person, dq=STILL, q=READY, arm_stamp=None, seen=True, in_force=UNHINDERED):
        """Decide once; person: x of a ball [m], an observation, or None."""
        self.time = round(self.time + PERIOD, 9)
        if seen and isinstance(person, float):
            person = ball(self.time, person)
        arm = ArmState(self.time if arm_stamp is None else arm_stamp, q, dq)
        self.decisions.append(self.supervisor.decide(self.time, arm, person, in_force))
        return self.decisions[-1]

    def approach(self, start, speed, seconds, dq=STILL):
        """Decide while a ball approaches along x, from a position [m] at a speed [m/s]."""
        return [self.decide(float(start - speed * PERIOD * k), dq) for k in range(round(seconds / PERIOD))]

    def events(self):
        return [event.kind for decision in self.decisions for event in decision.events]
