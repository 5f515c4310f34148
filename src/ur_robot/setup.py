"""Python package of ur_robot, installed by catkin."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(packages=["ur_robot", "ur_robot.emulated"], package_dir={"": "src"}))
