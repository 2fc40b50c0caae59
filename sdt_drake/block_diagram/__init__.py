"""Block diagrams as a control engineer draws them, of any Drake diagram.

`walk` says what there is to see, `drawn` lays it out and writes it in Graphviz' language.
"""

from sdt_drake.block_diagram.drawing import drawn
from sdt_drake.block_diagram.walk import walk

__all__ = ["drawn", "walk"]
