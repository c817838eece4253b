"""Looking at a model with sliders, hover and click, in a notebook and as a page of its own."""
