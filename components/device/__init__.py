"""The haptic device: a linkage with motors and encoders, and its observer."""
