"""A running scene as a page shows and changes it, whether a server runs it or the page itself."""
