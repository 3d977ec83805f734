"""Diagnosis by rules: candidates ranked by a penalised likelihood, the verdict by fixed limits.

The predecessor of `bowden.diagnosis.search`, kept until that is no worse on any row of the results
page; `bowden diagnose --method rules` runs it. Nothing outside imports it but `diagnose`.
"""
