"""From box to model: the steps of `bowden commission`, what each measures, and where it stands."""
