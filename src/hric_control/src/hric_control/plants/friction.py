"""Friction of a joint: a sigmoid of the velocity, as identified on the Panda, and a bristle that holds it at rest.

The sigmoid is zero at rest, so on its own it lets a joint creep under the smallest effort. The bristle is a spring: it
is deflected by the joint's motion and exerts the torque breakaway * z/GIVE for a deflection z. The deflection is
bounded, by GIVE at rest, decreasing with the speed to 0 at FADE:
    dz/dt = dq while |z| < GIVE (1 - (dq/FADE)^2)^2, else z follows this bound.
This is the limit of the elasto-plastic law (Dupont, Hayward, Armstrong, Altpeter, Single state elastoplastic friction
models, IEEE Transactions on Automatic Control 47, 2002) that has no creep below the bound. The LuGre model is not used:
its bristles creep a little in every cycle of a load below the breakaway torque, so that noise alone would move the arm.
Above the speed FADE only the sigmoid acts, as it was identified. A bristle returns no more energy than it has stored.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from hric_core.errors import ParameterError
from hric_core.parameters import Mistakes, as_number, refused, unknown

PHI = ("phi1", "phi2", "phi3")
Phi = tuple[float, float, float]
"""Parameters of the sigmoid friction of one joint: phi1 [N m], phi2 [s/rad], phi3 [rad/s]."""
BREAKAWAY = "breakaway"
"""Optional key in `friction_parameters`: largest effort that the bristle of a joint at rest withstands [N m]."""
GIVE = 1e-4
"""Deflection of a bristle at breakaway [rad] (project default, unconfirmed).

There is no measured value for this arm; 1e-5 to 1e-3 rad is realistic. The drift of a joint at rest is of this size."""
FADE = 0.1
"""Speed above which a bristle has no effect [rad/s] (project default, unconfirmed).

In a log of a real arm, the friction near rest that the published sigmoid does not explain, 0.05 to 0.2 N m, vanishes
between 0.1 and 0.3 rad/s."""


def sigmoid_torque(dq: npt.NDArray[np.float64], phi: Sequence[float]) -> npt.NDArray[np.float64]:
    """Return the sigmoid friction of one joint at many velocities; a plant subtracts it from the joint's effort.

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
    """Return the sigmoid friction parameters of each joint, in the order of `joint_names`.

    They are (phi1 [N m], phi2 [s/rad], phi3 [rad/s]) for each joint.

    Args:
        parameters: either {phi1: [n], phi2: [n], phi3: [n]} or {joint: {phi1: .., phi2: .., phi3: ..}}.
        joint_names: names of the joints.

    Raises:
        ParameterError: a joint or a value is missing, or phi1 or phi2 is below 0.
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
            phi = as_number(source["phi1"]), as_number(source["phi2"]), as_number(source["phi3"])
        except (KeyError, IndexError, TypeError, ValueError) as error:
            raise ParameterError(
                f"friction_parameters: phi1, phi2 and phi3 of {joint} are missing or not numbers; got "
                f"{dict(parameters)}"
            ) from error
        if phi[0] < 0.0 or phi[1] < 0.0:
            raise refused(
                f"friction_parameters: (phi1, phi2) of {joint}", phi[:2], "0 or more each, as friction opposes motion"
            )
        result.append(phi)
    return result


def refuse_other_joints(parameters: Any, joint_names: Sequence[str]) -> None:
    """Refuse keys in `friction_parameters` that would have no effect.

    Raises:
        ParameterError: a key is neither a joint nor a parameter, or a list has the wrong length; all are listed.
    """
    mistakes, valid = Mistakes(), (*PHI, BREAKAWAY)
    for key, value in parameters.items() if isinstance(parameters, Mapping) else ():
        with mistakes.noted():
            if key in valid and (not isinstance(value, list | tuple) or len(value) != len(joint_names)):
                raise refused(
                    f"friction_parameters.{key}", value, f"{len(joint_names)} values, for {', '.join(joint_names)}"
                )
            if key not in valid and key not in joint_names:
                raise unknown("joint", key, (*joint_names, *valid), "friction_parameters")
        for name in value if key in joint_names and isinstance(value, Mapping) else ():
            with mistakes.noted():
                if name not in valid:
                    raise unknown("parameter", name, valid, f"friction_parameters.{key}")
    mistakes.raise_all()


def bristle_torque(dq: npt.NDArray[np.float64], time: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return the friction torque of a bristle with breakaway 1 N m during a motion that starts at rest.

    Args:
        dq: velocity of the joint, shape (m,) [rad/s].
        time: times of the samples, increasing, shape (m,) [s].

    Returns:
        torque that a plant subtracts from the joint's effort, shape (m,) [N m]; proportional to the breakaway.
    """
    bound = np.maximum(1.0 - (dq / FADE) ** 2, 0.0) ** 2
    strains = np.diff(time, prepend=time[:1]) * dq / GIVE
    bend, torques = 0.0, []
    for strain, limit in zip(strains.tolist(), bound.tolist(), strict=True):
        bend = min(max(bend + strain, -limit), limit)
        torques.append(bend)
    return np.array(torques)


def breakaways(parameters: Mapping[str, Any], joint_names: Sequence[str]) -> list[float]:
    """Return the breakaway torque of each joint's bristle [N m], from `friction_parameters`; 0 if none is given.

    Raises:
        ParameterError: a value is not a finite number of 0 or more.
    """
    in_order, result = parameters.get(BREAKAWAY, [0.0] * len(joint_names)), []
    for i, joint in enumerate(joint_names):
        try:
            by_name = parameters.get(joint)
            value = as_number(in_order[i] if by_name is None else by_name.get(BREAKAWAY, 0.0))
        except (IndexError, TypeError, ValueError):
            value = math.nan
        if not 0.0 <= value < math.inf:
            raise ParameterError(
                f"friction_parameters: {BREAKAWAY} of {joint} must be a finite number of 0 or more [N m]; got "
                f"{dict(parameters)}"
            )
        result.append(value)
    return result
