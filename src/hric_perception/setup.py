"""Python package of hric_perception, installed by catkin."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

PARTS = ("emg", "human", "lsl", "plate", "sync", "trigno", "view")
packages = ["hric_perception", *(f"hric_perception.{part}" for part in PARTS)]
setup(**generate_distutils_setup(packages=packages, package_dir={"": "src"}))
