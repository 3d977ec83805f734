"""`bowden studio`: the bench in a browser, on this machine only."""
