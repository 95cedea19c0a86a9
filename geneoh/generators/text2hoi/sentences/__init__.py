"""What a sentence asks for, and the sentences that networks learn from."""
