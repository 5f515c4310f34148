"""Python package of franka_real, installed by catkin."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(packages=["franka_real"], package_dir={"": "src"}))
