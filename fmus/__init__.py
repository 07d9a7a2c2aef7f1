"""Builds FMUs from components, and checks them."""
