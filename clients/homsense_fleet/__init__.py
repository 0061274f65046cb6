"""A simulated world and its devices; it shares no code with the estimator."""
