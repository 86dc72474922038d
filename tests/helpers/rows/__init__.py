"""Functions over arrays with leading axes, a table by floor, and how a batch is compared with its rows alone."""
