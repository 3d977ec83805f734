"""What a model misses: `compare` measures the gap, `calibrate` moves parameters to close it."""
