"""The drawing of a mechanism, for figures, live page and replays alike."""
