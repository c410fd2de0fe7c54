"""Say what pyproject.toml cannot: the maps lie beside the packages, and inside `ciberrato` once installed."""

from setuptools import find_packages, setup

setup(
    packages=[*find_packages(include=["ciberrato*", "agent*", "simulator_stub*"]), "ciberrato.maps"],
    package_dir={"ciberrato.maps": "maps"},
)
