"""The stage program by its costates: exact stages, limits by funnel and scan, and a bound."""
