"""The observers that were tried, as a plugin: whatever imports this has their block."""

from hapticlink.components.blocks import BLOCKS
from studies.observer import tried_observer

BLOCKS.register(tried_observer.NAME, tried_observer.tried_observer)
