"""The joint friction that was identified on the Panda: a sigmoid of the velocity."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from hric_control.errors import ParameterError
from hric_control.parameters import as_number

PHI = ("phi1", "phi2", "phi3")
Phi = tuple[float, float, float]
"""phi1 [N m], phi2 [s/rad], phi3 [rad/s] of one joint."""


def sigmoid_torque(dq: npt.NDArray[np.float64], phi: Sequence[float]) -> npt.NDArray[np.float64]:
    """Friction of one joint over many velocities, as a plant takes it away.

    Args:
        dq: joint velocity, shape (n,) [rad/s].
        phi: phi1 [N m], phi2 [s/rad], phi3 [rad/s].

    Returns:
        phi1 / (1 + exp(-phi2 (dq + phi3))) - phi1 / (1 + exp(-phi2 phi3)), shape (n,) [N m].
    """
    phi1, phi2, phi3 = phi
    curve: npt.NDArray[np.float64] = 0.5 * phi1 * (np.tanh(0.5 * phi2 * (dq + phi3)) - np.tanh(0.5 * phi2 * phi3))
    return curve


def sigmoid_parameters(parameters: Any, joint_names: Sequence[str]) -> list[Phi]:
    """(phi1 [N m], phi2 [s/rad], phi3 [rad/s]) of each joint, in the order of `joint_names`.

    Args:
        parameters: either {phi1: [n], phi2: [n], phi3: [n]} or {joint: {phi1: .., phi2: .., phi3: ..}}.

    Raises:
        ParameterError: a joint or a value is missing.
    """
    if not isinstance(parameters, Mapping) or not parameters:
        raise ParameterError(
            "friction: identified needs friction_parameters: {phi1: [...], phi2: [...], phi3: [...]}, one value "
            "per joint"
        )
    result = []
    for i, joint in enumerate(joint_names):
        per_joint = parameters.get(joint)
        try:
            source = per_joint if per_joint is not None else {phi: parameters[phi][i] for phi in PHI}
            result.append((as_number(source["phi1"]), as_number(source["phi2"]), as_number(source["phi3"])))
        except (KeyError, IndexError, TypeError, ValueError) as error:
            raise ParameterError(
                f"friction_parameters: phi1, phi2 and phi3 of {joint} are missing or not numbers; got "
                f"{dict(parameters)}"
            ) from error
    return result
