"""Python package of hric_experiments, installed by catkin."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(packages=["hric_experiments"], package_dir={"": "src"}))
