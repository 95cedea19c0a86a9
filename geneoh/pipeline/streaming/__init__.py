"""Online cleaning, frame by frame."""
