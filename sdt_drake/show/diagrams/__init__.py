"""Block diagrams as a control engineer draws them, of any Drake diagram.

`walk` says what there is to see, `drawn` lays it out and writes it in Graphviz' language.
"""

from sdt_drake.show.diagrams.drawing import drawn
from sdt_drake.show.diagrams.routing import NoWayError
from sdt_drake.show.diagrams.walk import Symbols, walk

__all__ = ["NoWayError", "Symbols", "drawn", "walk"]
