"""Tables of docs/objects.md and docs/objects_measured.md: hands and objects under noisy poses."""
