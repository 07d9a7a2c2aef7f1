"""Native FMUs: a component as generated C behind one FMI wrapper, in a binary of its own."""

from hapticlink.fmus.native.compiler import PLATFORMS, compile_library, host_platform

__all__ = ["PLATFORMS", "compile_library", "host_platform"]
