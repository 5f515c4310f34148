"""Python package of franka_hw_interface, installed by catkin."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(packages=["franka_hw_interface"], package_dir={"": "src"}))
