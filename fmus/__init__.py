"""Builds FMUs from components, and checks them."""

from hapticlink.fmus.build import build, build_native
from hapticlink.fmus.cache import cached
from hapticlink.fmus.check import check_fmu
from hapticlink.fmus.errors import FmuError

__all__ = ["FmuError", "build", "build_native", "cached", "check_fmu"]
