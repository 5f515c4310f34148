"""Python package of hric_experiments, installed by catkin."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

PACKAGES = ["hric_experiments", *(f"hric_experiments.{name}" for name in ("check_model", "export", "health", "report_html"))]
DATA = {"hric_experiments.report_html": ["assets/*"]}
setup(**generate_distutils_setup(packages=PACKAGES, package_dir={"": "src"}, package_data=DATA))
