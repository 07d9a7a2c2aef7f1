"""The equations of all components, without FMI, files or clocks."""
