"""Analytic and scanned objects as solids."""
