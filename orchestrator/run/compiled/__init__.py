"""The compiled loop: the operations of a plan as arrays, which a small C library carries out."""
