"""The haptic device: twin pantograph, encoders, observer."""
