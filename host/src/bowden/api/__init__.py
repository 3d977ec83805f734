"""What `import bowden` offers: one function a step, files or objects in, typed results out.

`offline` runs the model, compares, calibrates, estimates and diagnoses; `live` talks to a drive;
`tables` and `plots` turn every result into a pandas DataFrame and Plotly figures. Each function is
a thin layer over the packages that the command line uses too.
"""
