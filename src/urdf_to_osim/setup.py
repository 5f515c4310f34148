"""Python package of urdf_to_osim, installed by catkin."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(packages=["urdf_to_osim"], package_dir={"": "src"}))
