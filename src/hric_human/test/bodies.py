"""Bodies of the shipped subjects, and pinocchio's view of them."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio

from hric_human.body import Body, Subject, describe, load

SUBJECTS = Path(__file__).parents[1] / "config" / "subjects"
NAMES = ("P05_female", "P50_female", "P50_male", "P95_male")
PARTS = {"right_arm": 7, "left_arm": 7, "both_arms": 14, "upper_body": 20, "whole_body": 32}


def subject(name: str = "P50_male", **changes: Any) -> Subject:
    return replace(load(SUBJECTS / f"{name}.yaml"), **changes)


def body(name: str = "P50_male", parts: str = "whole_body", **changes: Any) -> Body:
    return describe(subject(name, parts=parts, **changes))


class Posed:
    """A body at named joint angles [deg], as pinocchio sees it, with its root link in the origin."""

    def __init__(self, body: Body, **angles: float) -> None:
        # A free root joint, since pinocchio does not count what is fixed to the world.
        self.model = pinocchio.buildModelFromXML(body.urdf, pinocchio.JointModelFreeFlyer())
        self.data = self.model.createData()
        self.q = pinocchio.neutral(self.model)
        for name, angle in angles.items():
            self.q[self.model.joints[self.model.getJointId(name)].idx_q] = np.radians(angle)
        pinocchio.framesForwardKinematics(self.model, self.data, self.q)
        pinocchio.ccrba(self.model, self.data, self.q, np.zeros(self.model.nv))

    def point(self, link: str, p_link: Any = (0.0, 0.0, 0.0)) -> np.ndarray:
        """A point of a link, in axes of the root [m]."""
        return np.asarray(self.data.oMf[self.model.getFrameId(link)].act(np.asarray(p_link, dtype=float)))

    def rotation(self, link: str) -> np.ndarray:
        return np.asarray(self.data.oMf[self.model.getFrameId(link)].rotation)
