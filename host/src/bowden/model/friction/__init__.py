"""Laws of friction between cable and conduit, one to a file: equation, source, units, limit.

Coulomb's law is the base. The others are terms and factors that turn into it in a limit, and that
the mesh's kernels multiply together:

    mu = (mu_d (1 + stribeck) + viscous) * tension factor * (1 +- direction asymmetry)

The numbers are fields of `bowden.model.transmission.FrictionLaw`.
"""
