"""Native FMUs: a component as generated C, compiled with an FMI wrapper."""

from hapticlink.fmus.native.compiler import PLATFORMS, compile_library, host_platform

__all__ = ["PLATFORMS", "compile_library", "host_platform"]
