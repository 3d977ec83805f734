"""The offline model as an FMU (FMI 3, co-simulation): what `bowden export-fmu` writes."""
