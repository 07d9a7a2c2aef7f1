"""The page on which a mouse is the hand: its server is a process beside the haptic loop."""
