"""Python package of hric_controllers, installed by catkin."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(packages=["hric_controllers"], package_dir={"": "src"}))
