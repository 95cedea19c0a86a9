"""Made and scanned objects as solids."""
