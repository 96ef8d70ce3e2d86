"""Engines that are other people's."""
