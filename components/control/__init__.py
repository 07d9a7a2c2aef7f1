"""Control laws of the device."""
