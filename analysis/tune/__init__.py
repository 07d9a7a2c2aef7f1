"""Gains that are as stiff as stability and energy allow."""
