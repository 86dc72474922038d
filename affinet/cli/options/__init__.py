"""The command line: which commands there are, and what each can be told.

Nothing here imports what does the work of a command: `affinet --help` is there at once, and so is what a shell completes.
"""

from affinet.cli.options.whole import parser as parser
