"""Block diagrams as a control engineer draws them, of any Drake diagram.

`walk` says what there is to see, `drawn` lays it out and writes it in Graphviz' language.
"""

from sdt_drake.show.diagrams.drawing import drawn
from sdt_drake.show.diagrams.walk import Symbols, walk

__all__ = ["Symbols", "drawn", "walk"]
