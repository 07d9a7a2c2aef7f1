"""Identification: the parameters of a device and of an arm from a log of encoders and forces."""
