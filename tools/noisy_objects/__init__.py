"""Tables of docs/objects.md: what noisy objects do to hands, and how well objects are cleaned."""
