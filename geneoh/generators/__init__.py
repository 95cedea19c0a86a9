"""Networks that make interactions instead of cleaning them."""
