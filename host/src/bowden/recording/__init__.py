"""Recordings: one type, its readers and writers. Never needs a drive."""
