"""Muscles for the OpenSim model of a body: DeGrooteFregly2016Muscle with function-based paths and rigid tendons."""

from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from hric_core.errors import HricError
from hric_human.muscles import curves
from hric_human.muscles.muscle_set import MuscleSet, ScaledMuscle

NOTE = (
    "Muscles act on coordinates through polynomials of length, without points on bodies, so the results of "
    "JointReaction lack the muscles' joint loads. The joint reactions recorded in the run include them."
)
"""Comment that is written into the OpenSim model."""


def with_muscles(model: str, muscles: MuscleSet) -> str:
    """Return the text of an OpenSim model with the muscles of its body added; ideal actuators are left out.

    Args:
        model: text of the OpenSim model, whose coordinates have the names of the body's joints.
        muscles: muscles of the body.

    Raises:
        HricError: a coordinate is missing, or the text is not a model.
    """
    try:
        root = ElementTree.fromstring(model)
    except ElementTree.ParseError as error:
        raise HricError(f"muscles can be added only to an OpenSim model, and this text is none: {error}") from error
    paths = _coordinate_paths(root)
    model_element = root.find("Model")
    if model_element is None:
        raise HricError("muscles can be added only to an OpenSim model, and this text has no element Model")
    forces = model_element.find("ForceSet")
    forces = SubElement(model_element, "ForceSet", name="forceset") if forces is None else forces
    objects = forces.find("objects")
    objects = SubElement(forces, "objects") if objects is None else objects
    objects.append(ElementTree.Comment(f" {NOTE} "))
    for muscle in muscles.scaled:
        missing = [joint for joint in muscle.joints if joint not in paths]
        if missing:
            raise HricError(
                f"muscle {muscle.name} needs the coordinate {missing[0]}; valid: {', '.join(sorted(paths))}"
            )
        objects.append(_muscle(muscle, [paths[joint] for joint in muscle.joints]))
    ElementTree.indent(root, "\t")
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True)


def _coordinate_paths(root: Element) -> dict[str, str]:
    """Return the paths of the coordinates in the model's joint set, by name."""
    joints = root.findall("Model/JointSet/objects/*")
    return {
        str(coordinate.get("name")): f"/jointset/{joint.get('name')}/{coordinate.get('name')}"
        for joint in joints
        for coordinate in joint.iter("Coordinate")
    }


def _muscle(muscle: ScaledMuscle, coordinates: list[str]) -> Element:
    made = Element("DeGrooteFregly2016Muscle", name=muscle.name)
    path = SubElement(made, "FunctionBasedPath", name="path")
    SubElement(path, "coordinate_paths").text = " ".join(coordinates)
    function = SubElement(SubElement(path, "length_function"), "MultivariatePolynomialFunction")
    SubElement(function, "coefficients").text = " ".join(map(repr, muscle.coefficients))
    SubElement(function, "dimension").text = str(len(coordinates))
    SubElement(function, "order").text = str(muscle.order)
    numbers = {
        "max_isometric_force": muscle.force,
        "optimal_fiber_length": muscle.optimal_length,
        "tendon_slack_length": muscle.slack_length,
        "pennation_angle_at_optimal": 0.0,
        "max_contraction_velocity": curves.MAX_VELOCITY,
        "activation_time_constant": curves.RISE,
        "deactivation_time_constant": curves.FALL,
        "fiber_damping": 0.0,
        "passive_fiber_strain_at_one_norm_force": curves.PASSIVE_STRAIN,
    }
    for name, value in numbers.items():
        SubElement(made, name).text = repr(value)
    SubElement(made, "ignore_tendon_compliance").text = "true"
    return made
