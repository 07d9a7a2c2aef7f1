"""A linkage: bodies, joints, loops, and its kinematics as a graph."""
