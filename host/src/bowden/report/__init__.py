"""Results for people: words, plots, and one HTML page that opens anywhere and loads nothing."""
