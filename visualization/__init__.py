"""What is drawn: figures, the mechanism, the live page, replays, comparisons."""
