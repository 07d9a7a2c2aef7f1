"""A scene as a page in one file, which runs it by itself."""
