"""Numbers that `stability` and `run` print, against runs of fresh scenes from recorded seeds.

Nothing here knows how a verdict is computed: `hl.run` and what `hl.stability` records are all that
is used. A run begins at the told equilibrium in the told hand, a little off: the linkage by
`linkage.start`, the handle by a connection to `haptic_device.x_start`, an arm that presses by the
offset of its wrench, as its mass begins at the handle. The hold `passive` is run as `zoh`,
as a verdict is said to be without its friction. Growth rates are those of `run_modes.py`.
"""
