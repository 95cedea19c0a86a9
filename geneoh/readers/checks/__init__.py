"""What contradicts geneoh's conventions in a sequence that was read."""
