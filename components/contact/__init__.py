"""Contacts of a linkage with an enclosure and obstacles."""
