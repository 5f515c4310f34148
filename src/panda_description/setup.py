"""Python package of panda_description, installed by catkin."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(packages=["panda_description"], package_dir={"": "src"}))
