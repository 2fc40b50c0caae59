"""A backend of matplotlib whose windows are lists: `module://helpers.window`."""

from matplotlib.backend_bases import FigureManagerBase
from matplotlib.backends.backend_agg import FigureCanvasAgg

shown = []


class FigureManager(FigureManagerBase):
    """Windows that close as soon as all of them are shown."""

    @classmethod
    def pyplot_show(cls, *, block):
        from matplotlib.pyplot import figure, get_fignums

        assert block
        shown.extend(figure(number).canvas.figure for number in get_fignums())


class FigureCanvas(FigureCanvasAgg):
    """A canvas in such a window."""

    manager_class = FigureManager
