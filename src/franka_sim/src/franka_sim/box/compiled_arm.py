"""Compiled dynamics of the arm: gravity, inverse dynamics, estimate of the external torque."""

from array import array
from collections.abc import Callable, Sequence
from functools import partial

from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_sim.box.compiled_fields import CompiledFields
from franka_sim.model_library.parameters import arm_parameters
from hric_core.geometry import FloatArray
from hric_core.native import load

Vector = Sequence[float]
_inverse_dynamics: Callable[..., list[float]] = load("hric_arm").inverse_dynamics
_external_torque: Callable[..., list[float]] = load("hric_arm").external_torque
_STILL = (0.0,) * 7


class CompiledArm:
    """Inverse dynamics and kinematic fields of the arm.

    Args:
        urdf_xml: robot description.
        arm_id: prefix of the arm's link names.
        min_singular_value: singular value of the stiffness frame's Jacobian below which the estimated wrench is zero.
        accelerometers: see `CompiledFields`.

    Attributes:
        fields: compiled kinematic fields of the robot state.
        external_torque: function that updates the filtered estimate of the external joint torque by one cycle, and
            returns the gravity torque at q_now [N m]; set by `take_model`. Its arguments, 7 floats each but the first:
            (cycles per second [1/s], coefficient of the low-pass filter per cycle [1]); q at the start of the cycle;
            the estimate, a list, written in place; dq, q_now, dq_now, tau, friction as in
            `estimates.ExternalTorque.update`.

    Raises:
        DescriptionError, UnknownNameError: the URDF has no such arm.
    """

    external_torque: Callable[..., list[float]]

    def __init__(
        self, urdf_xml: str, arm_id: str, min_singular_value: float, accelerometers: Sequence[FloatArray] = ()
    ) -> None:
        self._arm = arm_parameters(urdf_xml, arm_id)
        self.fields = CompiledFields(self._arm, min_singular_value, accelerometers)

    def take_model(self, model: KdlFrankaModel) -> None:
        """Copy payload and mounting of the arm from the model."""
        total = model.total_inertial
        self._mounting = array("d", [*model.gravity_base, *total.inertia.ravel(), total.mass, *total.com])
        self.external_torque = partial(_external_torque, self._arm, self._mounting)

    def inverse_dynamics(self, q: Vector, dq: Vector, ddq: Vector) -> list[float]:
        """Return M(q) ddq + C(q, dq) dq + g(q) [N m], for q, dq, ddq in rad and s. Needs `take_model` before."""
        return _inverse_dynamics(self._arm, self._mounting, q, dq, ddq)

    def gravity(self, q: Vector) -> list[float]:
        """Return g(q), 7 floats [N m]; q: 7 floats [rad]. Needs `take_model` before."""
        return self.inverse_dynamics(q, _STILL, _STILL)
