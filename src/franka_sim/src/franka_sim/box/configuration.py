"""What clients tell the control box of load, frames, gains and thresholds."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.robot_state import RobotMode
from franka_hw_interface.transforms import check_transform
from franka_sim.box.compiled_arm import CompiledArm
from franka_sim.box.config import BoxConfig, CollisionBehavior
from franka_sim.box.estimates import ExternalTorque, wrench_estimator
from franka_sim.box.friction import friction_law
from franka_sim.box.internal_impedance import CartesianImpedanceLaw, JointImpedanceLaw
from franka_sim.box.reflexes import Reflexes
from franka_sim.box.requests import Outcome
from franka_sim.box.self_collision import SelfCollision
from franka_sim.box.state import BoxState
from hric_control.errors import HricError

Floats = Sequence[float]
HIGHEST_CUTOFF = 1000.0
"""A filter of this cut-off frequency is off (libfranka, setFilters) [Hz]."""
FILTERS = ("joint position", "joint velocity", "Cartesian position", "Cartesian velocity", "controller")


@dataclass(slots=True)
class Told:
    """What was told and changes no law of the box.

    Attributes:
        guiding_axes: which axes a hand may move: x, y, z, R, P, Y; guiding_elbow: and the elbow. (The arm is guided freely in all.)
        cutoffs: of the five filters [Hz].
    """

    guiding_axes: tuple[bool, ...] = (True,) * 6
    guiding_elbow: bool = True
    cutoffs: tuple[float, ...] = (HIGHEST_CUTOFF,) * 5


class ConfiguredBox:
    """State, model, laws and estimates of the box, and the requests that change them.

    Each request answers SUCCESS, INVALID_ARGUMENT (the reason is reported; what was told before stays) or NOT_POSSIBLE in a mode that forbids it.

    Args:
        model: what the box knows of the arm.
        config: parameters.
        report: called with one line for people whenever something is refused or the arm protects itself.
        compiled: computes the same faster; None: KDL does.
    """

    def __init__(
        self, model: KdlFrankaModel, config: BoxConfig, report: Callable[[str], None] | None = None, compiled: CompiledArm | None = None
    ) -> None:
        self.model, self.config, self.report = model, config, report or (lambda text: None)
        self.told = Told()
        self._friction = None if config.friction is None else friction_law(config.friction, model.joint_names)
        self._external, self._compiled = ExternalTorque(model, config, compiled), compiled
        estimate_wrench = wrench_estimator(model, config.least_singular_value) if compiled is None else compiled.fields.wrench
        self.state = BoxState(model, config.time_step, config.collision_behavior, estimate_wrench)
        self.state.tau_ext_hat_filtered = self._external.value
        self.state.compiled = None if compiled is None else compiled.fields
        self._take_gravity()
        self.joint_impedance = JointImpedanceLaw(model, config.limits, config.rotor_inertia, config.time_step)
        self._cartesian_impedance: CartesianImpedanceLaw | None = None
        self._cartesian_revision = -1
        self._reflexes = Reflexes(config, SelfCollision(model, config))

    def take_wrench_noise(self, noise: list[float], peak: float) -> None:
        """Let the estimate of the external wrench have noise, from now on.

        Args:
            noise: 3 forces [N] and 3 moments [N m], base axes; whoever measures changes it in place each cycle.
            peak: none of its numbers will be larger, nor will they in other axes [N], [N m].
        """
        self.state.wrench_noise = noise
        self._reflexes.take_wrench_noise(peak)

    @property
    def cartesian_impedance(self) -> CartesianImpedanceLaw:
        """The internal Cartesian impedance; its gains cost some time at the first call and after a change of the frames."""
        law = self._cartesian_impedance
        if law is None:
            config = self.config
            law = self._cartesian_impedance = CartesianImpedanceLaw(self.model, config.limits, config.rotor_inertia, config.time_step)
        elif self._cartesian_revision != self.model.revision:
            law.update_frames()
        self._cartesian_revision = self.model.revision
        return law

    def _tell(self, what: str, change: Callable[[], object]) -> Outcome:
        if self.state.robot_mode is RobotMode.MOVE and not self.config.settings_while_moving:
            self.report(f"{what} refused: not possible while a motion runs")
            return Outcome.NOT_POSSIBLE
        try:
            change()
        except HricError as error:
            self.report(f"{what} refused: {error}")
            return Outcome.INVALID_ARGUMENT
        return Outcome.SUCCESS

    def _take_gravity(self) -> None:
        """q (7 floats) [rad] -> g(q), 7 floats [N m], of what the box was told; and none is computed yet."""
        self._gravity: Callable[[Floats], list[float]] = self.model.gravity_list if self._compiled is None else self._compiled.gravity
        self._gravity_torque: list[float] | None = None

    def _tell_model(self, what: str, change: Callable[[], object]) -> Outcome:
        def all_of_it() -> None:
            change()
            self._external.take_model()
            self._take_gravity()
            self.state.take_configuration()

        return self._tell(what, all_of_it)

    def set_load(self, mass: float, com: Floats, inertia: Floats) -> Outcome:
        """Payload [kg], its centre of mass in the flange [m], its inertia about that, 9 floats [kg m^2]."""
        return self._tell_model("set_load", lambda: self.model.set_load(mass, com, inertia))

    def set_NE_T_EE(self, NE_T_EE: Floats) -> Outcome:
        """End effector in the nominal one, 16 floats, column-major."""
        return self._tell_model("set_NE_T_EE", lambda: self.model.set_ee(self.model.F_T_NE @ check_transform(NE_T_EE, "NE_T_EE")))

    def set_EE_T_K(self, EE_T_K: Floats) -> Outcome:
        """Stiffness frame in the end effector, 16 floats, column-major."""
        return self._tell_model("set_EE_T_K", lambda: self.model.set_stiffness_frame(check_transform(EE_T_K, "EE_T_K")))

    def set_joint_impedance(self, K_theta: Floats) -> Outcome:
        """Stiffness of the internal joint impedance, 7 floats [N m/rad]."""
        return self._tell("set_joint_impedance", lambda: self.joint_impedance.set_stiffness(K_theta))

    def set_cartesian_impedance(self, K_x: Floats) -> Outcome:
        """Stiffness of the internal Cartesian impedance, 3 [N/m] and 3 [N m/rad], axes of the stiffness frame."""
        return self._tell("set_cartesian_impedance", lambda: self.cartesian_impedance.set_stiffness(K_x))

    def set_collision_behavior(self, *thresholds: Floats) -> Outcome:
        """Eight lists in the order of `CollisionBehavior`; torques [N m], forces [N], moments [N m]."""

        def change() -> None:
            if len(thresholds) != 8:
                raise HricError(f"eight lists of thresholds are needed; got {len(thresholds)}")
            self.state.thresholds = CollisionBehavior(*(tuple(row) for row in thresholds))
            self._reflexes.take_thresholds(self.state)

        return self._tell("set_collision_behavior", change)

    def set_guiding_mode(self, axes: Sequence[bool], elbow: bool) -> Outcome:
        """Which of the six axes, and the elbow, a hand may move; kept, and not acted upon."""

        def change() -> None:
            if len(axes) != 6:
                raise HricError(f"six axes are needed; got {len(axes)}")
            self.told.guiding_axes, self.told.guiding_elbow = tuple(map(bool, axes)), bool(elbow)

        return self._tell("set_guiding_mode", change)

    def set_filters(self, cutoffs: Floats) -> Outcome:
        """Cut-off frequencies of FILTERS, 1 to 1000 Hz, 1000: off. The controller's one acts on torque commands; the others have no effect."""

        def change() -> None:
            if len(cutoffs) != len(FILTERS) or not all(math.isfinite(f) and 1.0 <= f <= HIGHEST_CUTOFF for f in cutoffs):
                raise HricError(f"cut-off frequencies of {', '.join(FILTERS)} must be 1 to {HIGHEST_CUTOFF:g} Hz; got {list(cutoffs)}")
            self.told.cutoffs = tuple(map(float, cutoffs))

        return self._tell("set_filters", change)

    def torque_filter_gain(self) -> float:
        """What one cycle of the controller's low-pass takes of a new torque, 0 to 1."""
        cutoff = self.told.cutoffs[-1]
        return 1.0 if cutoff >= HIGHEST_CUTOFF else float(1.0 - np.exp(-2.0 * np.pi * cutoff * self.config.time_step))
