"""Motion generators of the control box: what a client commands each millisecond, checked and turned into a desired joint motion."""

from franka_sim.box.motion.factory import make_generator as make_generator
from franka_sim.box.motion.generator import MotionGenerator as MotionGenerator
