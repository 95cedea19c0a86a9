"""Detection of faults in a track before it is cleaned."""
