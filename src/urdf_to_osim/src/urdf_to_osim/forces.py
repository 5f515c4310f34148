"""OpenSim forces at the joints (damping, friction, stops, actuators), and mimic joints as coupler constraints."""

import math

import opensim

from hric_control.plants import sigmoid_parameters
from hric_core.urdf import ONE_COORDINATE, Joint
from urdf_to_osim import joints
from urdf_to_osim.options import Options
from urdf_to_osim.prepare import ConversionPlan

PRISMATIC = "prismatic"


def add(model: opensim.Model, plan: ConversionPlan, options: Options) -> None:
    """Add the forces that the options select, and couplers, to a model that already has its joints."""
    # Model.addForce would traverse the complete model each time: with a hundred joints it took most of the
    # conversion.
    acting = model.updForceSet()
    single = {joint.name: joint for joint in plan.robot.joints.values() if joint.type in ONE_COORDINATE}
    for joint in single.values():
        name = plan.joints[joint.name]
        _add_losses(acting, joint, name, options, plan.friction_velocities.get(joint.name))
        if options.stops and math.isfinite(joint.lower):
            acting.adoptAndAppend(_stop(joint, name, options))
        if options.actuators and joint.mimic is None:
            acting.adoptAndAppend(_actuator(joint, name))
        if joint.mimic is not None:
            model.addConstraint(_coupler(joint, name, plan.joints[joint.mimic.joint]))
    _set_mimic_defaults(model, plan)


def _add_losses(acting: opensim.ForceSet, joint: Joint, name: str, options: Options, velocity: float | None) -> None:
    if options.damping and joint.damping > 0.0:
        force = opensim.SpringGeneralizedForce(name)
        force.setName(f"{name}_damping")
        force.setStiffness(0.0)
        force.setRestLength(0.0)
        force.setViscosity(joint.damping)
        acting.adoptAndAppend(force)
    if (expression := friction_expression(joint, options, velocity)) is not None:
        force = opensim.ExpressionBasedCoordinateForce(name, expression)
        force.setName(f"{name}_friction")
        acting.adoptAndAppend(force)


def friction_expression(joint: Joint, options: Options, velocity: float | None) -> str | None:
    """Return a joint's friction effort [N m or N] as an OpenSim expression of its velocity `qdot` [rad/s or m/s].

    None if the joint has no friction. Coulomb: -f tanh(dq/v) with v = `velocity`, which is None without it.
    Sigmoid (C. Gaz et al., Dynamic identification of the Franka Emika Panda robot, IEEE RA-L 4(4), 2019):

    -(phi1 / (1 + exp(-phi2 (dq + phi3))) - phi1 / (1 + exp(-phi2 phi3))),

    written with 1 / (1 + exp(-x)) = (1 + tanh(x/2)) / 2, which cannot overflow.
    """
    if velocity is not None:
        return f"-{joint.friction!r}*tanh(qdot/{velocity!r})"
    if options.friction == "sigmoid" and joint.name in options.friction_parameters:
        phi1, phi2, phi3 = sigmoid_parameters(options.friction_parameters, [joint.name])[0]
        return f"({-0.5 * phi1!r})*(tanh({0.5 * phi2!r}*(qdot+({phi3!r})))-({math.tanh(0.5 * phi2 * phi3)!r}))"
    return None


def _stop(joint: Joint, name: str, options: Options) -> opensim.Force:
    """Return the stop of a joint as a CoordinateLimitForce, which for rotations expects degrees, N m/deg, N m s/deg."""
    degree = 1.0 if joint.type == PRISMATIC else math.pi / 180.0
    stiffness, damping, transition = stop_parameters(joint, options)
    force = opensim.CoordinateLimitForce(
        name,
        joint.upper / degree,
        stiffness * degree,
        joint.lower / degree,
        stiffness * degree,
        damping * degree,
        transition / degree,
    )
    force.setName(f"{name}_stop")
    return force


def stop_parameters(joint: Joint, options: Options) -> tuple[float, float, float]:
    """Return (stiffness, damping, transition length) of a joint's stop.

    Units: N m/rad, N m s/rad, rad; for a prismatic joint N/m, N s/m, m.
    """
    if joint.type == PRISMATIC:
        return options.stop_stiffness_linear, options.stop_damping_linear, options.stop_transition_linear
    return options.stop_stiffness, options.stop_damping, options.stop_transition


def _actuator(joint: Joint, name: str) -> opensim.Force:
    """Return an actuator of a joint, whose control is the effort [N m or N].

    Its limits are in the model, but OpenSim does not enforce them; whoever sets controls must clamp them.
    """
    actuator = opensim.CoordinateActuator(name)
    actuator.setName(f"{name}_actuator")
    actuator.setOptimalForce(1.0)
    actuator.setMinControl(-joint.effort)
    actuator.setMaxControl(joint.effort)
    return actuator


def _coupler(joint: Joint, name: str, source: str) -> opensim.Constraint:
    assert joint.mimic is not None
    names = opensim.ArrayStr()
    names.append(source)
    coupler = opensim.CoordinateCouplerConstraint()
    coupler.setName(f"{name}_mimic")
    coupler.setIndependentCoordinateNames(names)
    coupler.setDependentCoordinateName(name)
    # A LinearFunction would be written with only six digits by OpenSim.
    coefficients = opensim.Vector(2, joint.mimic.offset)
    coefficients.set(0, joint.mimic.multiplier)
    coupler.setFunction(opensim.PolynomialFunction(coefficients))
    return coupler


def _set_mimic_defaults(model: opensim.Model, plan: ConversionPlan) -> None:
    """Set the default value of each mimic joint to its law, so that OpenSim need not move other joints at the start."""
    described = plan.robot.joints

    def start(joint: Joint) -> float:
        if joint.mimic is None:
            return joints.default_value(joint)
        return joint.mimic.multiplier * start(described[joint.mimic.joint]) + joint.mimic.offset

    for joint in described.values():
        if joint.mimic is not None and joint.type in ONE_COORDINATE:
            model.updJointSet().get(plan.joints[joint.name]).upd_coordinates(0).setDefaultValue(start(joint))
