"""bowden: host tools for a drive that feels through a cable-conduit transmission."""

__version__ = "0.2.0"
