"""The Franka Panda: URDF from xacro, identified dynamics, friction and limits with their sources."""

from panda_description.description import Argument as Argument
from panda_description.description import arguments as arguments
from panda_description.description import load as load
from panda_description.description import process_xacro as process_xacro
from panda_description.parameters import CartesianLimit as CartesianLimit
from panda_description.parameters import JointLimit as JointLimit
from panda_description.parameters import cartesian_limits as cartesian_limits
from panda_description.parameters import friction_parameters as friction_parameters
from panda_description.parameters import ignored_pairs as ignored_pairs
from panda_description.parameters import inertials as inertials
from panda_description.parameters import joint_limit_parameters as joint_limit_parameters
from panda_description.parameters import joint_limits as joint_limits
