"""The three denoising stages and their input."""
