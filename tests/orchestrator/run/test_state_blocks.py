"""The numbers of holds and energy tanks, read and written as few arrays."""

import ctypes

from hapticlink.orchestrator.run.compiled.state import Array, _views


def test_neighbours_in_memory_are_one_view_and_others_are_not():
    memory = (ctypes.c_double * 7)(*range(7))
    first = ctypes.addressof(memory)
    sizes = {0: 2, 2: 1, 3: 0, 4: 2, 6: 1}  # the number 3 is between the second and the fourth
    arrays = [Array(f"at {k}", first + 8 * k, False, n) for k, n in sizes.items()]
    views = _views(arrays)
    assert [view.tolist() for view in views] == [[0.0, 1.0, 2.0], [4.0, 5.0, 6.0]]
    views[1][:] = -1.0
    assert [*memory] == [0.0, 1.0, 2.0, 3.0, -1.0, -1.0, -1.0]
