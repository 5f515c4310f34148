"""Python package of mujoco_ros_control, installed by catkin."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(packages=["mujoco_ros_control"], package_dir={"": "src"}))
