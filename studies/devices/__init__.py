"""The study of devices: what each shipped device can render of the report's five-bar, and whether
its verdicts and margins of stability are those of runs.

Scene `closed-loop-ideal` with the device, Coriolis compensation and a pull of 0.5 N along x. It is
judged at the start pose in the hands of `stability`. The largest stable stiffness is that of the
coupling, 100 N/m, times the margin there: the largest factor on all gains, dampings by its root,
with which no hand is unstable. Two runs of 60 s check each device, with gains of 0.8 and 1.25 times
the margin, in the hand of the worst case, 1 um off at first. The run is stable if the handle's
speed in its last 5 s is less than half of what it was early.
"""
