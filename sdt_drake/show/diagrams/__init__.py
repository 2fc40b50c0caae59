"""Block diagrams of any Drake diagram, drawn as control engineers draw them.

`walk` finds the blocks and wires, and `laid_out` places them on a page. `dot_text` writes a page
as text, and `painted` as a picture.
"""

from sdt_drake.show.diagrams.dot import dot_text
from sdt_drake.show.diagrams.page import Page, laid_out
from sdt_drake.show.diagrams.paint import PICTURES, painted
from sdt_drake.show.diagrams.routing import NoWayError
from sdt_drake.show.diagrams.walk import Symbols, walk

__all__ = ["PICTURES", "NoWayError", "Page", "Symbols", "dot_text", "laid_out", "painted", "walk"]
