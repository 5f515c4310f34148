"""Load, frames, gains and thresholds of the control box, and the requests that set them."""

from collections.abc import Callable, Mapping, Sequence
from math import exp, isfinite, pi, tanh

from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.transforms import check_frame
from franka_sim.box.compiled_arm import CompiledArm
from franka_sim.box.config import BoxConfig, CollisionBehavior
from franka_sim.box.estimates import ExternalTorque
from franka_sim.box.internal_impedance import CartesianImpedanceLaw, ImpedanceLaw, JointImpedanceLaw
from franka_sim.box.reflexes import Reflexes
from franka_sim.box.requests import ControllerMode, RequestOutcome
from franka_sim.box.self_collision import SelfCollision
from franka_sim.box.state import BoxState
from hric_control.plants import sigmoid_parameters
from hric_core.errors import HricError

Floats = Sequence[float]
HIGHEST_CUTOFF = 1000.0
"""Cut-off frequency at which a filter is off (libfranka, setFilters) [Hz]."""
FILTERS = ("joint position", "joint velocity", "Cartesian position", "Cartesian velocity", "controller")


FrictionLaw = Callable[[Floats], list[float]]
"""Function that maps dq (7 floats [rad/s]) to the friction torque that the motor must overcome, 7 floats [N m]."""


def friction_law(parameters: Mapping[str, Mapping[str, float]], joint_names: Sequence[str]) -> FrictionLaw:
    """Return the sigmoid friction law of Gaz et al. (IEEE RA-L 2019, supplement, Table I), zero at rest.

    tau_f = phi1 / (1 + exp(-phi2 (dq + phi3))) - phi1 / (1 + exp(-phi2 phi3))
          = phi1/2 (tanh(phi2 (dq + phi3) / 2) - tanh(phi2 phi3 / 2))

    Args:
        parameters: phi1 [N m], phi2 [s/rad], phi3 [rad/s] by joint name.
        joint_names: joints in order.

    Raises:
        ParameterError: a joint or a value is missing, or not finite.
    """
    sigmoids = sigmoid_parameters(parameters, joint_names)
    rows = [(0.5 * phi1, 0.5 * phi2, phi3, tanh(0.5 * phi2 * phi3)) for phi1, phi2, phi3 in sigmoids]

    def law(dq: Floats) -> list[float]:
        return [a * (tanh(b * (v + c)) - rest) for v, (a, b, c, rest) in zip(dq, rows, strict=True)]

    return law


class ConfiguredBox:
    """Base of `ControlBox`: robot state, arm model, control laws and estimates, and the requests that change settings.

    Each request returns SUCCESS, INVALID_ARGUMENT (with a report of the reason; the old values remain), or NOT_POSSIBLE
    in a mode that forbids it.

    Args:
        model: the box's model of the arm.
        compiled: compiled dynamics of the same arm.
        config: parameters.
        report: callback for one line of text when a request is refused or the arm protects itself.

    Attributes:
        guiding_axes: True for each axis x, y, z, R, P, Y that may be guided by hand; guiding_elbow: the same for the
            elbow. (The simulated arm can be guided in all of them.)
        cutoffs: cut-off frequencies of FILTERS [Hz].
    """

    def __init__(
        self,
        model: KdlFrankaModel,
        compiled: CompiledArm,
        config: BoxConfig,
        report: Callable[[str], None] | None = None,
    ) -> None:
        self.model, self.config, self.report = model, config, report or (lambda text: None)
        self.guiding_axes: tuple[bool, ...] = (True,) * 6
        self.guiding_elbow = True
        self.cutoffs: tuple[float, ...] = (HIGHEST_CUTOFF,) * len(FILTERS)
        self._friction = None if config.friction is None else friction_law(config.friction, model.joint_names)
        self._external, self._compiled = ExternalTorque(compiled, config), compiled
        self.state = BoxState(model, config.time_step, config.collision_behavior, compiled.fields)
        self.state.tau_ext_hat_filtered = self._external.value
        self._take_model()
        self.joint_impedance = JointImpedanceLaw(model, config.limits, config.rotor_inertia, config.time_step)
        self._cartesian_impedance: CartesianImpedanceLaw | None = None
        self._cartesian_revision = -1
        self._reflexes = Reflexes(config, SelfCollision(model, config))

    def take_wrench_noise(self, noise: list[float], peak: float) -> None:
        """Add noise to the estimate of the external wrench from now on.

        Args:
            noise: 3 forces [N] and 3 moments [N m], base axes; the sensor changes them in place each cycle.
            peak: upper bound of the noise along any axis, also of other frames [N], [N m].
        """
        self.state.wrench_noise = noise
        self._reflexes.take_wrench_noise(peak)

    @property
    def cartesian_impedance(self) -> CartesianImpedanceLaw:
        """Internal Cartesian impedance; the first access, and one after a change of frames, computes its gains."""
        law = self._cartesian_impedance
        if law is None:
            config = self.config
            law = self._cartesian_impedance = CartesianImpedanceLaw(
                self.model, config.limits, config.rotor_inertia, config.time_step
            )
        elif self._cartesian_revision != self.model.revision:
            law.update_frames()
        self._cartesian_revision = self.model.revision
        return law

    def impedance(self, controller: ControllerMode) -> ImpedanceLaw | None:
        """Return the internal impedance law of a controller mode; None: torques are commanded externally."""
        if controller is ControllerMode.JOINT_IMPEDANCE:
            return self.joint_impedance
        return self.cartesian_impedance if controller is ControllerMode.CARTESIAN_IMPEDANCE else None

    def _set(self, what: str, change: Callable[[], object]) -> RequestOutcome:
        if self.state.moving and not self.config.settings_while_moving:
            self.report(f"{what} refused: not possible while a motion runs")
            return RequestOutcome.NOT_POSSIBLE
        try:
            change()
        except HricError as error:
            self.report(f"{what} refused: {error}")
            return RequestOutcome.INVALID_ARGUMENT
        return RequestOutcome.SUCCESS

    def _take_model(self) -> None:
        """Pass the model's present payload and mounting to the compiled dynamics."""
        self._compiled.take_model(self.model)
        self._gravity_torque: list[float] | None = None

    def _set_model(self, what: str, change: Callable[[], object]) -> RequestOutcome:
        def all_of_it() -> None:
            change()
            self._take_model()
            self.state.take_configuration()

        return self._set(what, all_of_it)

    def set_load(self, mass: float, com: Floats, inertia: Floats) -> RequestOutcome:
        """Set the payload: mass [kg], centre of mass in the flange [m], inertia about it, 9 floats [kg m^2]."""
        return self._set_model("set_load", lambda: self.model.set_load(mass, com, inertia))

    def set_NE_T_EE(self, NE_T_EE: Floats) -> RequestOutcome:
        """Set the end effector in the nominal end-effector frame, 16 floats, column-major."""
        return self._set_model(
            "set_NE_T_EE", lambda: self.model.set_ee(self.model.F_T_NE @ check_frame(NE_T_EE, "NE_T_EE"))
        )

    def set_EE_T_K(self, EE_T_K: Floats) -> RequestOutcome:
        """Set the stiffness frame in the end-effector frame, 16 floats, column-major."""
        return self._set_model("set_EE_T_K", lambda: self.model.set_stiffness_frame(check_frame(EE_T_K, "EE_T_K")))

    def set_joint_impedance(self, K_theta: Floats) -> RequestOutcome:
        """Set the stiffness of the internal joint impedance, 7 floats [N m/rad]."""
        return self._set("set_joint_impedance", lambda: self.joint_impedance.set_stiffness(K_theta))

    def set_cartesian_impedance(self, K_x: Floats) -> RequestOutcome:
        """Set the stiffness of the internal Cartesian impedance, 3 [N/m] and 3 [N m/rad], stiffness-frame axes."""
        return self._set("set_cartesian_impedance", lambda: self.cartesian_impedance.set_stiffness(K_x))

    def set_collision_behavior(self, *thresholds: Floats) -> RequestOutcome:
        """Set the contact and collision thresholds: eight lists in the order of `CollisionBehavior` [N m], [N]."""

        def change() -> None:
            if len(thresholds) != 8:
                raise HricError(f"eight lists of thresholds are needed; got {len(thresholds)}")
            self.state.thresholds = CollisionBehavior(*(tuple(row) for row in thresholds))
            self._reflexes.take_thresholds(self.state)

        return self._set("set_collision_behavior", change)

    def set_guiding_mode(self, axes: Sequence[bool], elbow: bool) -> RequestOutcome:
        """Store which of the six axes, and whether the elbow, may be guided by hand; no effect on the simulated arm."""

        def change() -> None:
            if len(axes) != 6:
                raise HricError(f"six axes are needed; got {len(axes)}")
            self.guiding_axes, self.guiding_elbow = tuple(map(bool, axes)), bool(elbow)

        return self._set("set_guiding_mode", change)

    def set_filters(self, cutoffs: Floats) -> RequestOutcome:
        """Set the cut-off frequencies of FILTERS, 1 to 1000 Hz (off); only the controller's filter has an effect."""

        def change() -> None:
            if len(cutoffs) != len(FILTERS) or not all(isfinite(f) and 1.0 <= f <= HIGHEST_CUTOFF for f in cutoffs):
                raise HricError(
                    f"cut-off frequencies of {', '.join(FILTERS)} must be 1 to {HIGHEST_CUTOFF:g} Hz; got "
                    f"{list(cutoffs)}"
                )
            self.cutoffs = tuple(map(float, cutoffs))

        return self._set("set_filters", change)

    def torque_filter_gain(self) -> float:
        """Return the weight of the newest torque command in the controller's low-pass filter, 0 to 1."""
        cutoff = self.cutoffs[-1]
        return 1.0 if cutoff >= HIGHEST_CUTOFF else 1.0 - exp(-2.0 * pi * cutoff * self.config.time_step)
