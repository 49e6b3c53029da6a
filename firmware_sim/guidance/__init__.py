"""Guidance that flies: the reference model between set-point and law."""
