"""Show Plotly figures of the executed notebooks with the copy of the library that the site has."""

import plotly.io as pio
from plotly.io._base_renderers import MimetypeRenderer


class Site(MimetypeRenderer):
    """A figure as a piece of HTML without the library."""

    def to_mimebundle(self, fig_dict: dict) -> dict:
        """Return the figure's HTML."""
        html = pio.to_html(fig_dict, include_plotlyjs=False, full_html=False)
        return {"text/html": html}


pio.renderers["site"] = Site()
pio.renderers.default = "site"
