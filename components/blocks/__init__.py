"""The blocks of the report, one FMU a file."""
