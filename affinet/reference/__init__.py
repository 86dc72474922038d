"""What there is, said from models, docstrings and files: for `affinet list`, the JSON schema, completion and the docs."""
