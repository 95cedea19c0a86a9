"""A body with fingers: its skeleton, its motion, and arms that follow wrists."""
