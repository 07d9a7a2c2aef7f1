"""Numbers that `stability` prints, against runs: fresh scenes from recorded seeds, runs that start
at the told poses in the told hands, and growth rates that are fitted to them.

Nothing here knows how a verdict is computed: only `hl.run` and what `hl.stability` records is used.
"""
