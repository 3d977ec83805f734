"""The generator of everything that firmware and host must agree on.

``python -m shared.dictionary`` reads ``shared/object_dictionary.yaml`` and writes the C table, the
EDS, the DBC, the host's accessors and the docs page; ``--check`` only compares. The data goes
`schema` (the file as written) -> `dictionary` (every object of the device) -> `lint` -> one module
for each output: `c_table`, `host_module`, `eds`, `dbc`, `docs_page`.
"""
