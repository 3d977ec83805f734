"""Where the drive's firmware runs: `target` is the one interface, each other module one place."""
