"""A scene as one program: its blocks, rates and holds as one native FMU."""
