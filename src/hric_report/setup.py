"""Python package of hric_report, installed by catkin."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import find_packages, setup

setup(
    **generate_distutils_setup(
        packages=find_packages("src"),
        package_dir={"": "src"},
        package_data={"hric_report.html": ["assets/*"], "hric_report.trial": ["assets/*"]},
    )
)
