"""Other multibody codes of the comparison, one a file, each an optional dependency.

A peer is a module with
    NAME, METHODS           what tables call it, and the integrators it offers here
    prepare(linkage, wrench, q, qd, method, h) -> run
    run(steps) -> (x, y, seconds)
                            the operational point after so many steps of h from the start, and
                            the time that the steps took, without building and setting up
A run starts anew each time it is called.
"""
