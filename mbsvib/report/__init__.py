"""A report: one page for any browser, without network, that shows a mechanism, its modes and its responses.

``write(model, "report.html")`` puts everything into the file: the picture in 3-D that can be turned, with its modes
in motion; the table of modes; the response of any input to any output; topology, redundant constraints, what was
skipped and how accurate it all is; and all data for download as CSV. It needs plotly (extra ``report``), whose
library of JavaScript is part of the file.
"""

from mbsvib.report.page import html, write

__all__ = ["html", "write"]
__dir__ = __all__.copy
