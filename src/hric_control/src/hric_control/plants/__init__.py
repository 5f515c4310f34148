"""Common parts of all plants, independent of the engine: worlds, surfaces, wrenches, friction, stops, parameters.

Import all names from here, except those of `faces` (contact areas of two shapes).
"""

from hric_control.plants.bushings import BushingLaw, Bushings, LinkMotion
from hric_control.plants.config import DEFAULT_PLANT, GRAVITY, PlantConfig, WindowlessConfig, carried, rotor_inertia
from hric_control.plants.contact_law import ContactLaw
from hric_control.plants.divergence import DivergedError, Divergence
from hric_control.plants.driven_joints import DrivenJoints
from hric_control.plants.engine_plant import EnginePlant
from hric_control.plants.engine_robot import EngineRobot
from hric_control.plants.friction import (
    BREAKAWAY,
    PHI,
    Phi,
    breakaways,
    bristle_torque,
    refuse_other_joints,
    sigmoid_parameters,
    sigmoid_torque,
)
from hric_control.plants.models import Model, Models, model_of_object, model_of_urdf, payload
from hric_control.plants.moving_joints import Losses, MovingJoints
from hric_control.plants.spring_step import Springs
from hric_control.plants.stops import StopLaw, StopMemory, reciprocals
from hric_control.plants.surfaces import SurfaceRule, Surfaces, combine
from hric_control.plants.worlds import (
    PLAIN_LINK,
    WorldObject,
    load_masks,
    load_surfaces,
    load_world,
    masked,
    never_touching,
)
from hric_control.plants.wrenches import Wrenches

__all__ = [
    "BREAKAWAY",
    "DEFAULT_PLANT",
    "GRAVITY",
    "PHI",
    "PLAIN_LINK",
    "BushingLaw",
    "Bushings",
    "ContactLaw",
    "DivergedError",
    "Divergence",
    "DrivenJoints",
    "EnginePlant",
    "EngineRobot",
    "LinkMotion",
    "Losses",
    "Model",
    "Models",
    "MovingJoints",
    "Phi",
    "PlantConfig",
    "Springs",
    "StopLaw",
    "StopMemory",
    "SurfaceRule",
    "Surfaces",
    "WindowlessConfig",
    "WorldObject",
    "Wrenches",
    "breakaways",
    "bristle_torque",
    "carried",
    "combine",
    "load_masks",
    "load_surfaces",
    "load_world",
    "masked",
    "model_of_object",
    "model_of_urdf",
    "never_touching",
    "payload",
    "reciprocals",
    "refuse_other_joints",
    "rotor_inertia",
    "sigmoid_parameters",
    "sigmoid_torque",
]
