"""Synthetic bodies that gesture with their hands, with sentences: training data of BOTH2Hands."""
