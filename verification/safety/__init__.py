"""What the safety layer promises, tested against all commands of a second (docs/safety.md)."""
