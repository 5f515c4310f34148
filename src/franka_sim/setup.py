"""Python package of franka_sim, installed by catkin."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import find_packages, setup

sources = {"franka_sim.model_library": ["*.c"], "franka_sim.box": ["*.c"]}
setup(**generate_distutils_setup(packages=find_packages("src"), package_dir={"": "src"}, package_data=sources))
