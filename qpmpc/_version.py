"""The version, in a separate module: reading it does not import the public interface."""

__version__ = "0.1.0"
