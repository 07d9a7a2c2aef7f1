"""Exceptions raised while an FMU is built from a component."""


class FmuError(Exception):
    """No FMU can be built from a component, or a built FMU fails validation."""


class UnknownOperation(FmuError):
    """A CasADi operation cannot be written as straight-line Python."""


class CompilerError(FmuError):
    """The compiler reports an error."""


class UnsupportedPlatform(FmuError):
    """pythonfmu has no binary for this operating system and processor."""


class InvalidUnit(FmuError):
    """A unit string is not an SI unit in FMI's notation."""
