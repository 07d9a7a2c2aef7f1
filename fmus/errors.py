"""What can go wrong between a component and its FMU."""


class FmuError(Exception):
    """A component cannot become an FMU, or a built FMU fails its checks."""


class UnknownOperation(FmuError):
    """A CasADi operation has no straight-line Python form."""


class CompilerError(FmuError):
    """The compiler does not compile."""


class UnsupportedPlatform(FmuError):
    """pythonfmu has no binary for this operating system and processor."""


class InvalidUnit(FmuError):
    """A unit string is not an SI unit in FMI's notation."""
