"""The class of an FMU in this process, by FMI version."""

from hapticlink.orchestrator.fmi.in_process_fmi2 import InProcess
from hapticlink.orchestrator.fmi.in_process_fmi3 import InProcess3

IN_PROCESS = {"2": InProcess, "3": InProcess3}
