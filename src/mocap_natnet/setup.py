"""Python package of mocap_natnet, installed by catkin."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

PACKAGES = ["mocap_natnet", "mocap_natnet.codec", "mocap_natnet.client", "mocap_natnet.server"]
setup(**generate_distutils_setup(packages=PACKAGES, package_dir={"": "src"}))
