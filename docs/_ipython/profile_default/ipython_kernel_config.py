"""Settings of the kernels that execute the pages."""

c = get_config()  # noqa: F821
c.InlineBackend.figure_formats = {"svg"}
# an exact width, as it was asked for, not the one that is left after cutting margins
c.InlineBackend.print_figure_kwargs = {"bbox_inches": None}
c.HistoryManager.enabled = False
