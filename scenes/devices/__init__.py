"""Device files, which `[device] extends = NAME` names."""
