"""Hands in three dimensions, from MJCF and URDF files, and what they hold."""
