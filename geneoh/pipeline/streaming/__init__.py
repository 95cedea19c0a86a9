"""Cleaning of frames as they come."""
