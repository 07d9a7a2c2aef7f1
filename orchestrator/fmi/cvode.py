"""CVODE of SUNDIALS, by the libraries that FMPy brings: backward differentiation of orders 1 to 5
with a controlled error, Newton's method with a dense Jacobian by differences, and roots
(Hindmarsh et al., SUNDIALS: Suite of nonlinear and differential/algebraic equation solvers, ACM
Transactions on Mathematical Software 31, 2005). Settings are those of FMPy's `CVodeSolver`, so that
both take the same steps; that one goes on with what an FMU that has failed left behind.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from typing import Any

import fmpy.sundials as sun
import numpy as np
from fmpy.sundials.libraries import sundials_core, sundials_cvode

from hapticlink.orchestrator.base.arrays import Vector

CV_NORMAL, CV_ONE_STEP = 1, 2
CV_ROOT_RETURN = 2
MOST_STEPS = 20_000
"""Within one call, before the equations count as ones that cannot be solved."""
Equations = Callable[[float, Any, Any], int]
"""(t, x, result) -> status: 0; 1 where a shorter step may help; -1 where nothing would. Both
vectors are pointers to doubles."""


def _function(name: str, *types: Any, library: Any = sundials_cvode) -> Any:
    found = library[name]
    found.argtypes, found.restype = types, ctypes.c_int
    return found


_set_stop = _function("CVodeSetStopTime", ctypes.c_void_p, ctypes.c_double)
_clear_stop = _function("CVodeClearStopTime", ctypes.c_void_p)
_local_errors = _function("CVodeGetEstLocalErrors", ctypes.c_void_p, sun.N_Vector)
_weights = _function("CVodeGetErrWeights", ctypes.c_void_p, sun.N_Vector)
_count_steps = _function("CVodeGetNumSteps", ctypes.c_void_p, ctypes.POINTER(ctypes.c_long))
_silence = _function("SUNContext_ClearErrHandlers", ctypes.c_void_p, library=sundials_core)
_free_context = _function("SUNContext_Free", ctypes.POINTER(ctypes.c_void_p), library=sundials_core)
_free_matrix = _function("SUNMatDestroy", ctypes.c_void_p, library=sundials_core)
_free_solver = _function("SUNLinSolFree", ctypes.c_void_p, library=sundials_core)


class Unsolved(Exception):
    """CVODE has given up. worst: the index of the state with the largest error estimate relative to
    its tolerance, None where no step was tried."""

    def __init__(self, why: str, worst: int | None) -> None:
        super().__init__(why)
        self.worst = worst


class Cvode:
    """x' = derivatives(t, x) of `n` states, at least one, with `n_roots` functions of t and x whose
    changes of sign end a step. tolerance: relative. longest: step (s)."""

    def __init__(
        self,
        n: int,
        n_roots: int,
        derivatives: Equations,
        roots: Equations,
        tolerance: float,
        longest: float,
    ) -> None:
        self._error: BaseException | None = None
        self._said, self._steps, self._tolerance = "", 0, tolerance
        self._context = ctypes.c_void_p()
        _require(sun.SUNContext_Create(sun.SUN_COMM_NULL, ctypes.byref(self._context)))
        context = self._context
        _silence(context)
        self._x, self._bounds = (sun.N_VNew_Serial(n, context) for _ in range(2))
        self.states = sun.NV_DATA_S(self._x)
        """A pointer to the states."""
        self._memory = sun.CVodeCreate(sun.CV_BDF, context)
        self._callbacks = (
            sun.SUNErrHandlerFn(self._told),
            sun.CVRhsFn(lambda t, x, dx, _: self._called(derivatives, t, x, sun.NV_DATA_S(dx))),
            sun.CVRootFn(lambda t, x, z, _: self._called(roots, t, x, z)),
        )
        told, right_side, root_functions = self._callbacks
        _require(sun.SUNContext_PushErrHandler(context, told, None))
        memory, self._array(self._bounds)[:] = self._memory, 1.0
        _require(sun.CVodeInit(memory, right_side, 0.0, self._x))
        _require(sun.CVodeSVtolerances(memory, tolerance, self._bounds))
        _require(sun.CVodeRootInit(memory, n_roots, root_functions))
        self._matrix = sun.SUNDenseMatrix(n, n, context)
        self._solver = sun.SUNLinSol_Dense(self._x, self._matrix, context)
        _require(sun.CVodeSetLinearSolver(memory, self._solver, self._matrix))
        _require(sun.CVodeSetMaxStep(memory, longest))
        _require(sun.CVodeSetMaxNumSteps(memory, MOST_STEPS))
        _require(sun.CVodeSetNoInactiveRootWarn(memory))

    def begin(self, time: float, nominals: Vector) -> None:
        """Begin at a time (s) from what stands in `states`, without a history."""
        self._steps = self.steps
        self._array(self._bounds)[:] = self._tolerance * nominals
        _require(sun.CVodeSVtolerances(self._memory, self._tolerance, self._bounds))
        _require(sun.CVodeReInit(self._memory, time, self._x))

    def advance(self, until: float, *, stop: float, once: bool) -> tuple[float, bool]:
        """Go on to a time (s), or by one step of CVODE with `once`, evaluating nothing beyond
        `stop` (s): the time reached, and whether a root was found there. Raises Unsolved."""
        reached, memory = ctypes.c_double(), self._memory
        _require(_set_stop(memory, stop) if stop < math.inf else _clear_stop(memory))
        task = CV_ONE_STEP if once else CV_NORMAL
        status = sun.CVode(memory, until, self._x, ctypes.byref(reached), task)
        if self._error:
            error, self._error = self._error, None
            raise error
        if status < 0:
            raise Unsolved(self._said or f"status {status}", self._find_worst())
        return reached.value, status == CV_ROOT_RETURN

    @property
    def steps(self) -> int:
        """The steps that CVODE has taken."""
        count = ctypes.c_long()
        _require(_count_steps(self._memory, ctypes.byref(count)))
        return self._steps + count.value

    def close(self) -> None:
        sun.CVodeFree(ctypes.byref(ctypes.c_void_p(self._memory)))
        _free_solver(self._solver)
        _free_matrix(self._matrix)
        for vector in (self._x, self._bounds):
            sun.N_VDestroy_Serial(vector)
        _free_context(ctypes.byref(self._context))

    def _called(self, equations: Equations, time: float, x: Any, result: Any) -> int:
        try:
            return equations(time, sun.NV_DATA_S(x), result)
        except BaseException as error:  # which ctypes would print and forget
            self._error = error
            return -1

    def _told(self, line: int, function: bytes, file: bytes, message: bytes, *_: Any) -> None:
        self._said = message.decode(errors="replace")

    def _array(self, vector: Any) -> Vector:
        size = sun.NV_CONTENT_S(vector).contents.length
        return np.ctypeslib.as_array(sun.NV_DATA_S(vector), (size,))

    def _find_worst(self) -> int | None:
        if self.steps == self._steps:
            return None
        _local_errors(self._memory, self._x)
        _weights(self._memory, self._bounds)
        return int(np.argmax(np.abs(self._array(self._x) * self._array(self._bounds))))


def _require(status: int) -> None:
    assert status == 0, f"SUNDIALS returned {status}"
