"""Clips that show a verb."""
