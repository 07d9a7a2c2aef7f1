"""System Structure and Parameterization: SSPs read and written."""
