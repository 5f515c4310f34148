"""Control box of a simulated arm, from its parameters."""

from collections.abc import Callable, Sequence

from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_sim.box.compiled_arm import CompiledArm
from franka_sim.box.config import BoxConfig
from franka_sim.box.control_box import ControlBox
from franka_sim.box.internal_impedance import JointImpedanceLaw
from franka_sim.settings import BoxSettings
from hric_core.errors import CommandError, ParameterError
from hric_core.node import Node


def set_up_box(
    node: Node,
    settings: BoxSettings,
    config: BoxConfig,
    model: KdlFrankaModel,
    urdf_xml: str,
    report: Callable[[str], None],
) -> ControlBox:
    """Return a control box with the internal impedance of the parameters.

    Args:
        node: node of the parameters, for messages.
        settings: parameters of the arm.
        config: parameters of the box.
        model: the arm's model of itself.
        urdf_xml: robot description.
        report: callback for what the box reports.

    Raises:
        HricError: the impedance or the description cannot be used.
    """
    box = ControlBox(model, CompiledArm(urdf_xml, settings.arm_id, config.min_singular_value), config, report)
    _set_internal_impedance(node, settings.internal_impedance.stiffness, box.joint_impedance)
    return box


def _set_internal_impedance(node: Node, stiffness: Sequence[float], law: JointImpedanceLaw) -> None:
    """Set the stiffness of the internal joint impedance [N m/rad]; log gains lowered for stability."""
    requested = list(stiffness)
    try:
        law.set_stiffness(requested)
    except CommandError as error:
        raise ParameterError(f"{node.resolve('internal_impedance/stiffness')}: {error}") from None
    if law.stiffness != requested:
        lowered = ", ".join(f"{k:.0f}/{d:.1f}" for k, d in zip(law.stiffness, law.damping, strict=True))
        node.log_info(
            "internal impedance lowered to gains that are stable with this time step and rotor inertia, K/D per joint: "
            f"{lowered}"
        )
