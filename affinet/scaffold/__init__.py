"""Small working things to begin with, outside of the repository: `affinet new`."""
