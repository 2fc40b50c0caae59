"""Block diagrams as a control engineer draws them, of any Drake diagram.

`walk` tells what there is to see, and `laid_out` gives it places on a page. A page is written as
text by `dot_text`, and painted by `painted`.
"""

from sdt_drake.show.diagrams.dot import dot_text
from sdt_drake.show.diagrams.page import Page, laid_out
from sdt_drake.show.diagrams.paint import PICTURES, painted
from sdt_drake.show.diagrams.routing import NoWayError
from sdt_drake.show.diagrams.walk import Symbols, walk

__all__ = ["PICTURES", "NoWayError", "Page", "Symbols", "dot_text", "laid_out", "painted", "walk"]
