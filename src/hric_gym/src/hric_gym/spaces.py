"""Spaces of Gymnasium for actions and observations, and the fields of observations with their units."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from hric_core.errors import HricError
from hric_core.geometry import quaternion_from_rotation
from hric_run.observation import ArmObservation, SimulationState

try:
    from gymnasium import Env, ObservationWrapper, Wrapper, make, register
    from gymnasium.spaces import Box, Dict
except ImportError:
    raise HricError("hric_gym needs Gymnasium, which is not installed:  scripts/setup --with learning") from None

__all__ = [
    "FIELDS",
    "Box",
    "Dict",
    "Env",
    "Field",
    "ObservationWrapper",
    "Values",
    "Wrapper",
    "arm_fields",
    "as_values",
    "dict_space",
    "make",
    "person_fields",
    "register",
    "unit_box",
]
Values = dict[str, npt.NDArray[np.float32]]
"""Observation: array of values by name of the field, see FIELDS."""


@dataclass(frozen=True)
class Field:
    """Field of an observation.

    Attributes:
        shape: shape as text for the table in INTERFACE.md; n: number of the person's joints, m: of their muscles, k:
            size of the command.
        unit: unit of the values.
        text: description of the values.
    """

    shape: str
    unit: str
    text: str


FIELDS = {
    "q": Field("7", "rad", "joint positions of the arm"),
    "dq": Field("7", "rad/s", "joint velocities"),
    "tau": Field("7", "N m", "measured joint torques"),
    "ee_position": Field("3", "m", "position of the end effector (O_T_EE), world"),
    "ee_orientation": Field("4", "1", "orientation of the end effector, quaternion x, y, z, w with w at least 0"),
    "wrench": Field("6", "N, N m", "external force and moment, estimated by the control box (O_F_ext_hat_K)"),
    "goal": Field("3", "m", "goal of the end effector, or of the person's hand, world; see the table of tasks"),
    "command": Field("k", "as the action", "present command: setpoint of the joints, equilibrium pose, or torques"),
    "person_q": Field("n", "rad", "joint positions of the person"),
    "person_dq": Field("n", "rad/s", "joint velocities of the person"),
    "person_root": Field("3", "m", "position of the person's root link, world"),
    "hand_position": Field("3", "m", "position of the link of the person's hand, world"),
    "separation": Field("1", "m", "smallest distance of arm and person; negative: overlap"),
    "activation": Field("m", "1", "activation of each muscle; only with `drive` muscle"),
    "force_share": Field("1", "1", "largest share of a contact limit in the step; 10 or more: 10"),
}
"""Fields of observations; those of the person are absent if there is none."""


def unit_box(count: int) -> Box:
    """Return the space of `count` numbers from -1 to 1."""
    return Box(-1.0, 1.0, (count,), np.float32)


def dict_space(values: Values) -> Dict:
    """Return the space of observations with the fields and shapes of `values`."""
    return Dict({name: Box(-np.inf, np.inf, value.shape, np.float32) for name, value in values.items()})


def as_values(numbers: Mapping[str, Any]) -> Values:
    """Return an observation converted to float32, the element type of Gymnasium's spaces."""
    return {name: np.asarray(value, np.float32) for name, value in numbers.items()}


def arm_fields(arm: ArmObservation) -> dict[str, Any]:
    """Return the fields of an observation that describe the arm."""
    T = arm.T_base_ee
    assert T is not None and arm.wrench_base is not None, "the environment has refused other robots"
    return {
        "q": arm.q,
        "dq": arm.dq,
        "tau": arm.tau,
        "ee_position": T[:3, 3],
        "ee_orientation": quaternion_from_rotation(T[:3, :3]),
        "wrench": arm.wrench_base,
    }


def person_fields(observation: SimulationState) -> dict[str, Any]:
    """Return the fields of an observation that describe the person; empty if there is no person."""
    person = observation.person
    if person is None:
        return {}
    values: dict[str, Any] = {
        "person_q": person.q,
        "person_dq": person.dq,
        "person_root": person.T_world_root[:3, 3],
        "hand_position": person.T_world_hand[:3, 3],
        "separation": [observation.separation],
    }
    return values if person.activations is None else {**values, "activation": person.activations}
