"""Measures of an interaction: penetration, contact, accuracy, smoothness, realism."""
