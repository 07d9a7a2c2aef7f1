"""The page that `view` serves: its server is a process beside the haptic loop."""
