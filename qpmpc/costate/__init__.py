"""The stage program by its costates: exact stages, limits by a funnel, a bound for nothing."""
